"""What EXIF says about the lens, turned into p3i's focal length."""

import math
from dataclasses import dataclass

from PIL import Image as Pil

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
    f_px directly, if the sensor that follows from them can exist. A cropped picture has no known focal.
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

    equivalent = _number(block.get(FOCAL_LENGTH_35MM))
    if equivalent is not None:
        f_px = equivalent * math.hypot(size.width, size.height) / FRAME_DIAGONAL_MM
        return _sound(f_px * 36 / size.longer)

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
