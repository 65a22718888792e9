"""What EXIF says about the lens, turned into p3i's focal length."""

import math
from dataclasses import dataclass
from fractions import Fraction

from PIL import Image as Pil
from PIL.TiffImagePlugin import IFDRational

from p3i.size import Size

FOCAL_LENGTH = 0x920A
FOCAL_PLANE_X_RESOLUTION = 0xA20E
FOCAL_PLANE_Y_RESOLUTION = 0xA20F
FOCAL_PLANE_UNIT = 0xA210
FOCAL_LENGTH_35MM = 0xA405
PIXEL_WIDTH = 0xA002
PIXEL_HEIGHT = 0xA003
ORIENTATION = 0x0112
X_RESOLUTION, Y_RESOLUTION, RESOLUTION_UNIT = 0x011A, 0x011B, 0x0128
EXIF_BLOCK = 0x8769

# What speaks of a lens's field of view: with the four above the zoom by cropping.
_VIEW_TAGS = {
    FOCAL_LENGTH,
    FOCAL_LENGTH_35MM,
    FOCAL_PLANE_X_RESOLUTION,
    FOCAL_PLANE_Y_RESOLUTION,
    FOCAL_PLANE_UNIT,
    0xA404,
}
# What speaks of places in the old picture (subject area and location), or is a second block of such facts
# inside a TIFF (XMP, Photoshop's resources with a thumbnail).
_PLACE_TAGS = {0x9214, 0xA214, 700, 34377}

# Of a TIFF: sizes, depths, strips and tiles, compression, extra samples, tables, profile. They describe the
# old file's pixels and would contradict the new one's.
_STORAGE_TAGS = {
    256,
    257,
    258,
    259,
    262,
    273,
    277,
    278,
    279,
    284,
    317,
    320,
    322,
    323,
    324,
    325,
    338,
    339,
    347,
}
_STORAGE_TAGS |= {530, 531, 532, 34675}

# The diagonal of a 36 x 24 mm frame, to which the 35 mm-equivalent figure refers.
FRAME_DIAGONAL_MM = 43.27
# Millimetres in a FocalPlaneResolutionUnit: inch, centimetre, millimetre, micrometre.
_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 1e-3}
# Lenses and sensors outside these ranges are mistakes of the writing software, not cameras.
_FOCAL_RANGE_MM = (4.0, 2000.0)
_SENSOR_RANGE_MM = (2.0, 80.0)
# A picture whose shape differs by more than this from the one that EXIF records was cropped.
_SHAPE_TOLERANCE = 0.02


@dataclass(frozen=True, slots=True)
class ExifFocal:
    """The focal length found (35 mm-equivalent on p3i's terms, f_px = focal_mm / 36 * longer), or why not."""

    focal_mm: float | None
    note: str | None = None


def focal_from_exif(exif: Pil.Exif, size: Size) -> ExifFocal:
    """The focal length of a picture of `size` (its present pixels, before or after rotation alike).

    EXIF's 35 mm-equivalent figure F refers to the diagonal, f_px = F * diagonal / 43.27; p3i's focal_mm to
    the longer side, f_px = focal_mm / 36 * longer. Without F, FocalLength with FocalPlaneXResolution gives
    f_px directly, if the sensor that follows from them can exist; beside F, too, where F is the same rounded.
    A cropped picture has no known focal.
    """
    block = _block(exif)
    recorded = sorted(filter(None, (_number(block.get(tag)) for tag in (PIXEL_WIDTH, PIXEL_HEIGHT))))
    present = sorted((size.width, size.height))
    if len(recorded) == 2:
        recorded_shape, present_shape = recorded[0] / recorded[1], present[0] / present[1]
        # Half a pixel of rounding on a small picture is no crop.
        slack = _SHAPE_TOLERANCE + 1 / present[1]
        if abs(math.log(recorded_shape / present_shape)) > slack:
            note = "EXIF records another shape, so the picture was cropped: its focal length is not used"
            return ExifFocal(None, note)

    measured = _on_sensor(block, size, recorded)
    equivalent = _number(block.get(FOCAL_LENGTH_35MM))
    if equivalent is None:
        return measured
    if measured.focal_mm is not None and abs(_equivalent(measured.focal_mm, size) - equivalent) <= 0.5:
        return measured  # F is a whole number: this is what it was rounded from
    return _sound(equivalent * math.hypot(size.width, size.height) / FRAME_DIAGONAL_MM * 36 / size.longer)


def _on_sensor(block: dict[int, object], size: Size, recorded: list[float]) -> ExifFocal:
    """The focal by FocalLength and FocalPlaneXResolution; `recorded` are the two sides in EXIF, if any."""
    length_mm = _number(block.get(FOCAL_LENGTH))
    per_unit = _number(block.get(FOCAL_PLANE_X_RESOLUTION))
    if length_mm is None or per_unit is None:
        return ExifFocal(None)
    unit_mm = _UNIT_MM.get(int(_number(block.get(FOCAL_PLANE_UNIT)) or 2))
    across = _number(block.get(FOCAL_PLANE_Y_RESOLUTION)) or per_unit
    captured_px = recorded[1] if len(recorded) == 2 else size.longer
    if unit_mm is None or abs(math.log(across / per_unit)) > _SHAPE_TOLERANCE:
        return ExifFocal(None)
    per_mm = per_unit / unit_mm
    sensor_mm = captured_px / per_mm
    if not _SENSOR_RANGE_MM[0] <= sensor_mm <= _SENSOR_RANGE_MM[1]:
        return ExifFocal(
            None, f"EXIF speaks of a sensor {sensor_mm:.3g} mm wide: its focal length is not used"
        )
    return _sound(length_mm / sensor_mm * 36)


def reframed_exif(exif: bytes, size: Size, *, focal_mm: float | None) -> bytes:
    """The EXIF block of a photo of which another view is written, a picture of `size`.

    What it says of the lens's field of view gives way to `focal_mm` (35 mm-equivalent on p3i's terms; None
    where the view is no camera's, or its focal unknown); what it says of places in the old picture goes.
    """
    block = Pil.Exif()
    block.load(exif)
    inner = block.get_ifd(EXIF_BLOCK)
    length_mm = _number(inner.get(FOCAL_LENGTH))
    for tags in (block, inner):
        for tag in (_VIEW_TAGS | _PLACE_TAGS) & set(tags):
            del tags[tag]
    inner[PIXEL_WIDTH], inner[PIXEL_HEIGHT] = size.width, size.height
    if focal_mm is not None:
        inner[FOCAL_LENGTH_35MM] = max(1, round(_equivalent(focal_mm, size)))  # whole numbers only
        # The same again without rounding: pixels a centimetre of a sensor behind the lens.
        if length_mm is None or not _SENSOR_RANGE_MM[0] <= length_mm / focal_mm * 36 <= _SENSOR_RANGE_MM[1]:
            length_mm = focal_mm
        inner[FOCAL_LENGTH] = _rational(length_mm)
        per_cm = _rational(10 * size.longer * focal_mm / (36 * length_mm))
        inner[FOCAL_PLANE_X_RESOLUTION] = inner[FOCAL_PLANE_Y_RESOLUTION] = per_cm
        inner[FOCAL_PLANE_UNIT] = 3
    return block.tobytes()


def upright_exif(exif: bytes, *, dpi: float | None = None) -> bytes:
    """The EXIF block of a picture that is written upright: orientation 1, and nothing of its storage.

    `dpi` replaces the resolution that it speaks of.
    """
    block = Pil.Exif()
    block.load(exif)
    for tag in _STORAGE_TAGS & set(block):
        del block[tag]
    block[ORIENTATION] = 1
    if dpi is not None:
        block[X_RESOLUTION] = block[Y_RESOLUTION] = dpi
        block[RESOLUTION_UNIT] = 2  # inches
    return block.tobytes()


def _equivalent(focal_mm: float, size: Size) -> float:
    """EXIF's figure, which refers to the diagonal, for a focal that refers to the longer side."""
    return focal_mm / 36 * size.longer * FRAME_DIAGONAL_MM / math.hypot(size.width, size.height)


def _rational(value: float) -> IFDRational:
    return IFDRational(Fraction(value).limit_denominator(10_000))


def _sound(focal_mm: float) -> ExifFocal:
    low, high = _FOCAL_RANGE_MM
    if low <= focal_mm <= high:
        return ExifFocal(focal_mm)
    return ExifFocal(None, f"EXIF speaks of a focal length of {focal_mm:.3g} mm: it is not used")


def _block(exif: Pil.Exif) -> dict[int, object]:
    """The tags of the camera, wherever a writer put them."""
    return {**dict(exif), **dict(exif.get_ifd(EXIF_BLOCK))}


def _number(value: object) -> float | None:
    """A positive finite number, or None: EXIF writes 0 or 0/0 where it does not know."""
    try:
        number = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None
