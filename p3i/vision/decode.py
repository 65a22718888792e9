"""The bytes of a picture file -> upright RGB. The only place where a picture is decoded.

Pillow decodes whatever it can hold without loss; OpenCV decodes what Pillow would cut down to 8 bits or
does not know: 16-bit colour, float TIFF, Radiance HDR, PFM.
"""

import io
import re
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np
from PIL import Image as Pil
from PIL import ImageCms, ImageOps, UnidentifiedImageError

from p3i.errors import FileError
from p3i.size import Size
from p3i.vision.exif import ORIENTATION, ExifFocal, focal_from_exif

# Formats that are documents or need a foreign program (Ghostscript for EPS): never opened.
_NOT_PICTURES = {"EPS", "WMF", "MPEG", "HDF5", "GRIB", "BUFR"}
_HEIC_BRANDS = {b"heic", b"heix", b"hevc", b"hevx", b"heim", b"heis", b"mif1", b"msf1"}
_NO_FOCAL = ExifFocal(None)
_ALPHA_MODES = {"RGBA", "LA", "La", "PA", "RGBa"}
_DEEP_MODES = {"I", "F", "I;16", "I;16L", "I;16B", "I;16N"}


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """What a picture file held besides its colours, so that an answer can be written in kind.

    `format` is Pillow's name (PNG, JPEG, TIFF ...), `bits` the depth of a channel (8, 16; 32 for float),
    `alpha` float32 [H, W] in 0..1 where the file had transparency, `icc` and `exif` the raw blocks.
    """

    format: str
    bits: int = 8
    alpha: np.ndarray | None = None
    icc: bytes | None = None
    exif: bytes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """An upright picture: `pixels` float32 [H, W, 3] RGB in 0..1, `known` bool [H, W], and the rest."""

    pixels: np.ndarray
    known: np.ndarray
    source: Source
    focal_mm: float | None
    notes: tuple[str, ...]


def decode(data: bytes, *, name: str, max_px: int) -> Decoded:
    """Decode a picture; `name` is what messages call it.

    Raises FileError where the bytes are empty, no picture, damaged or cut off, a format whose extra is not
    installed, or hold more than `max_px` pixels.
    """
    if not data:
        raise FileError(f"{name} is empty (0 bytes)")
    with _own_pixel_limit(), _silent_opencv():
        try:
            return _decode(data, name=name, max_px=max_px)
        except FileError:
            raise
        except MemoryError:
            raise FileError(f"{name} does not fit into memory") from None
        except (
            Exception
        ) as error:  # decoders raise nearly anything on damaged files; all of it means the same
            raise FileError(f"{name} is damaged or cut off: {_reason(error)}") from error


def swap_red_blue(array: np.ndarray) -> np.ndarray:
    """BGR(A) to RGB(A) and back: the one place where OpenCV's channel order is turned. [H, W, 3 or 4]."""
    order = (2, 1, 0, 3) if array.shape[2] == 4 else (2, 1, 0)
    planes = cv2.split(array)  # several times faster than indexing on large pictures
    return np.asarray(cv2.merge([planes[channel] for channel in order]))


def _decode(data: bytes, *, name: str, max_px: int) -> Decoded:
    _prepare_heic(data, name)
    formats = [key for key in _known_formats() if key not in _NOT_PICTURES]
    try:
        picture = Pil.open(io.BytesIO(data), formats=formats)
    except UnidentifiedImageError:
        return _decode_with_opencv_only(data, name=name, max_px=max_px)
    _refuse_bomb(Size(*picture.size), name=name, max_px=max_px)
    exif = picture.getexif()
    orientation = exif.get(ORIENTATION, 1)
    focal = focal_from_exif(exif, Size(*picture.size))
    exif_bytes = picture.info.get("exif") or (exif.tobytes() if len(exif) else None)
    notes = _frames_note(picture)
    icc = picture.info.get("icc_profile")
    deep = _is_deep(picture, data)
    kind = picture.format or ""
    picture.load()
    array = _opencv_array(data) if deep else None
    if array is not None:
        array = _turned(array, orientation)
    else:
        upright = ImageOps.exif_transpose(picture)
        if upright.mode in _DEEP_MODES:
            array = np.asarray(upright)
        else:
            array = np.asarray(_as_rgb(upright, icc))
            icc = None if upright.mode in ("CMYK", "LAB") else icc
    return _from_array(array, kind=kind, icc=icc, exif=exif_bytes, focal=focal, notes=notes)


def _from_array(
    array: np.ndarray,
    *,
    kind: str,
    icc: bytes | None = None,
    exif: bytes | None = None,
    focal: ExifFocal = _NO_FOCAL,
    notes: tuple[str, ...] = (),
) -> Decoded:
    """An upright array [H, W] or [H, W, 1..4] of any number type -> Decoded."""
    if array.ndim == 2:
        array = array[:, :, None]
    channels = array.shape[2]
    colours = array if channels in (1, 3) else array[:, :, : channels - 1]
    pixels, known, range_note = _unit_range(colours)
    alpha = None
    if channels in (2, 4):
        alpha, _, _ = _unit_range(array[:, :, -1:])
        alpha = np.ascontiguousarray(alpha[:, :, 0])
        known &= alpha >= 0.5
        if (alpha == 1).all():
            alpha = None
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    bits = {1: 8, 2: 16}.get(array.dtype.itemsize, 32)
    return Decoded(
        pixels=np.ascontiguousarray(pixels),
        known=known,
        source=Source(format=kind, bits=bits, alpha=alpha, icc=icc, exif=exif),
        focal_mm=focal.focal_mm,
        notes=tuple(note for note in (*notes, range_note, focal.note) if note),
    )


def _unit_range(array: np.ndarray) -> tuple[np.ndarray, np.ndarray, str | None]:
    """Any numbers [H, W, C] -> float32 in 0..1, which pixels [H, W] are finite, a note if stretched."""
    if array.dtype in (np.uint8, np.uint16):
        scale = np.float32(1 / np.iinfo(array.dtype).max)
        return np.multiply(array, scale, dtype=np.float32), np.ones(array.shape[:2], bool), None
    if array.dtype == np.bool_:
        return array.astype(np.float32), np.ones(array.shape[:2], bool), None
    values = array.astype(np.float64)
    finite = np.isfinite(values)
    known = np.asarray(finite.all(axis=2))
    low, high = (values[finite].min(), values[finite].max()) if finite.any() else (0.0, 1.0)
    note = None
    if low < 0 or high > 1:
        note = f"values run from {low:.4g} to {high:.4g}: stretched to 0..1"
        values = (values - low) / (high - low) if high > low else np.zeros_like(values)
    return np.where(finite, values, 0).astype(np.float32), known, note


def _as_rgb(picture: Pil.Image, icc: bytes | None) -> Pil.Image:
    """An 8-bit Pillow picture of any mode -> RGB or RGBA; ink and Lab colours through their profile."""
    if picture.mode in _ALPHA_MODES or "transparency" in picture.info:
        return picture.convert("RGBA")
    if picture.mode == "P" and picture.palette is not None and picture.palette.mode == "RGBA":
        return picture.convert("RGBA")
    if picture.mode in ("CMYK", "LAB"):
        profile = None
        if icc and picture.mode == "CMYK":
            profile = ImageCms.ImageCmsProfile(io.BytesIO(icc))
        elif picture.mode == "LAB":
            profile = ImageCms.createProfile("LAB")
        if profile is not None:
            try:
                srgb = ImageCms.createProfile("sRGB")
                converted = ImageCms.profileToProfile(picture, profile, srgb, outputMode="RGB")
            except ImageCms.PyCMSError:  # a profile that does not fit its picture: the plain conversion below
                converted = None
            if converted is not None:
                return converted
    return picture.convert("RGB")


def _is_deep(picture: Pil.Image, data: bytes) -> bool:
    """Whether Pillow would cut the picture down to 8 bits."""
    if picture.format == "PNG":
        return len(data) > 24 and data[24] == 16
    if picture.format == "TIFF":
        tags = picture.tag_v2  # pyright: ignore[reportAttributeAccessIssue]
        if data[2:4] not in (b"*\0", b"\0*") and tags.get(ORIENTATION, 1) != 1:
            return False  # a turned BigTIFF is left to Pillow: OpenCV would turn it too
        depths = tags.get(258, (1,))
        return max(depths if isinstance(depths, tuple) else (depths,)) > 8 and tags.get(262) in (0, 1, 2)
    return False


def _opencv_array(data: bytes) -> np.ndarray | None:
    """The picture as OpenCV reads it, [H, W(, C)] in RGB order, as stored (not turned); None if it cannot."""
    data = _without_tiff_orientation(data)
    array = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if array is not None and array.ndim == 3 and array.shape[2] >= 3:
        array = swap_red_blue(array)
    return array


def _decode_with_opencv_only(data: bytes, *, name: str, max_px: int) -> Decoded:
    """What Pillow does not identify: float TIFF, HDR, PFM, or no picture at all."""
    kind, size, orientation = _tiff_header(data) or _float_header(data) or ("", None, 1)
    if size is None:
        raise FileError(f"{name} is no picture that p3i can read: {_looks_like(data)}")
    _refuse_bomb(size, name=name, max_px=max_px)
    array = _opencv_array(data)
    if array is None:
        raise FileError(f"{name} is damaged or cut off, or a kind of {kind} that OpenCV cannot decode")
    return _from_array(_turned(array, orientation), kind=kind)


def _tiff_tags(data: bytes) -> Iterator[tuple[int, int, int]]:
    """(tag, first value as a number, where the value stands) of a TIFF's first page; nothing for others."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    if order is None:
        return
    (offset,) = struct.unpack_from(order + "I", data, 4)
    (count,) = struct.unpack_from(order + "H", data, offset)
    for at in range(offset + 2, offset + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(order + "HH", data, at)
        (value,) = struct.unpack_from(order + ("H" if kind == 3 else "I"), data, at + 8)
        yield tag, value, at + 8


def _tiff_header(data: bytes) -> tuple[str, Size, int] | None:
    """Size and orientation of a TIFF's first page, from its tags; None if it is no TIFF."""
    tags = {tag: value for tag, value, _ in _tiff_tags(data)}
    if not (tags.get(256) and tags.get(257)):
        return None
    return "TIFF", Size(tags[256], tags[257]), tags.get(ORIENTATION, 1)


def _without_tiff_orientation(data: bytes) -> bytes:
    """The file with its orientation tag set to upright: OpenCV turns TIFFs even where it is told not to."""
    for tag, value, at in _tiff_tags(data):
        if tag == ORIENTATION and value != 1:
            upright = b"\1\0\0\0" if data[:2] == b"II" else b"\0\1\0\0"
            return data[:at] + upright + data[at + 4 :]
    return data


def _float_header(data: bytes) -> tuple[str, Size, int] | None:
    """Size of a Radiance HDR or PFM picture, from its text header; None if it is neither."""
    head = data[:4096]
    if head.startswith((b"#?RADIANCE", b"#?RGBE")):
        found = re.search(rb"\n-Y (\d{1,9}) \+X (\d{1,9})\n", head)
        return ("HDR", Size(int(found[2]), int(found[1])), 1) if found else None
    found = re.match(rb"P[Ff]\s+(\d{1,9})\s+(\d{1,9})\s", head)
    return ("PFM", Size(int(found[1]), int(found[2])), 1) if found else None


def _turned(array: np.ndarray, orientation: int) -> np.ndarray:
    """An array [H, W, ...] as stored -> upright, by EXIF's orientation 1..8 (others mean upright)."""
    if orientation in (5, 6, 7, 8):
        array = np.swapaxes(array, 0, 1)
    if orientation in (2, 3, 6, 7):
        array = array[:, ::-1]
    if orientation in (3, 4, 7, 8):
        array = array[::-1]
    return np.ascontiguousarray(array)


def _prepare_heic(data: bytes, name: str) -> None:
    """Let Pillow open HEIC if the extra is installed; raise FileError that names the extra if it is not."""
    if data[4:8] != b"ftyp" or data[8:12] not in _HEIC_BRANDS or b"avif" in data[8:64]:
        return
    try:
        from pillow_heif import register_heif_opener  # pyright: ignore[reportMissingImports]
    except ImportError:
        message = f"{name} is a HEIC photo, which needs an extra: pip install 'p3i[heic]', or save it as JPEG"
        raise FileError(message) from None
    register_heif_opener()


def _known_formats() -> list[str]:
    Pil.init()
    return list(Pil.OPEN)


def _refuse_bomb(size: Size, *, name: str, max_px: int) -> None:
    if size.width * size.height > max_px:
        found, limit = size.width * size.height / 1e6, max_px / 1e6
        raise FileError(
            f"{name} is {size.width} x {size.height}, {found:.4g} megapixels; the limit is {limit:.4g}."
            " Make it smaller, or raise the limit (max_px)"
        )


@contextmanager
def _own_pixel_limit() -> Iterator[None]:
    """Pillow's own limit, a module variable, gives way to ours, which speaks of it in our words."""
    before = Pil.MAX_IMAGE_PIXELS
    Pil.MAX_IMAGE_PIXELS = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        Pil.MAX_IMAGE_PIXELS = before


@contextmanager
def _silent_opencv() -> Iterator[None]:
    """OpenCV's warnings about odd tags go straight to stderr, past our own messages: not while we decode."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def _frames_note(picture: Pil.Image) -> tuple[str, ...]:
    frames = getattr(picture, "n_frames", 1)
    if frames <= 1 or picture.format == "MPO":  # an MPO is a photo with a preview or a depth map behind it
        return ()
    parts = "pages" if picture.format == "TIFF" else "frames"
    return (f"only the first of {frames} {parts} is used",)


def _looks_like(data: bytes) -> str:
    head = data[:256]
    if head.lstrip().startswith((b"<svg", b"<?xml")):
        return "it looks like SVG or XML"
    if head.startswith(b"%PDF"):
        return "it is a PDF document"
    if head.startswith((b"%!PS", b"\xc5\xd0\xd3\xc6")):
        return "it is PostScript"
    if head.startswith((b"\xff\x0a", b"\0\0\0\x0cJXL ")):
        return "it is JPEG XL; save it as PNG or JPEG"
    if head.startswith((b"\xff\xd8", b"\x89PNG", b"GIF8", b"BM", b"RIFF")):
        return "it begins like one, but is damaged or cut off"
    try:
        text = data[:4096].decode("utf-8", errors="strict" if len(data) <= 4096 else "ignore")
    except UnicodeDecodeError:
        return "no known format begins with these bytes"
    return (
        "it looks like text"
        if text.isprintable() or not set(text) & set(map(chr, range(9)))
        else "unknown bytes"
    )


def _reason(error: Exception) -> str:
    """The first line of a decoder's own complaint."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:160]
