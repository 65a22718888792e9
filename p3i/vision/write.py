"""Pictures -> files: whole or not at all, and never over something that is there."""

import io
import os
import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pil

from p3i.errors import FileError, UsageError
from p3i.files import write_bytes
from p3i.vision.decode import swap_red_blue
from p3i.vision.exif import upright_exif
from p3i.vision.tiff import encode_tiff_16

# Suffix -> Pillow's name of the format.
_FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
    ".bmp": "BMP",
}
_WITH_ALPHA = {"PNG", "TIFF", "WEBP"}
_WITH_16_BITS = {"PNG", "TIFF"}
_JPEG_QUALITY = 95


def write_image(
    path: str | os.PathLike[str],
    pixels: np.ndarray,
    *,
    force: bool = False,
    alpha: np.ndarray | None = None,
    bits: int = 8,
    icc: bytes | None = None,
    exif: bytes | None = None,
    text: Mapping[str, str] | None = None,
    kind: str | None = None,
    dpi: float | None = None,
) -> None:
    """Write a picture to a file, or to standard output for `-`.

    `pixels` is [H, W, 3] RGB, float in 0..1 (clipped, rounded), uint8 or uint16; `alpha` [H, W] likewise.
    The format follows the suffix of `path`, or `kind` (".png"), which `-` needs. `bits` 16 is kept by PNG
    and TIFF, other formats hold 8. `icc` and `exif` are raw blocks as `Source` holds them; the orientation
    is set to upright. `text` goes into a PNG as iTXt, keyword by keyword. `dpi` is the resolution, which
    WebP holds in its EXIF block only, if at all.

    The file appears whole or not at all: written beside its place, then renamed. Raises UsageError for a
    format that is not known or cannot hold what is asked, FileError where the file exists (without `force`)
    or cannot be written.
    """
    data = encode(
        pixels, kind=kind or Path(path).suffix, alpha=alpha, bits=bits, icc=icc, exif=exif, text=text, dpi=dpi
    )
    write_bytes(path, data, force=force)


def encode(
    pixels: np.ndarray,
    *,
    kind: str,
    alpha: np.ndarray | None = None,
    bits: int = 8,
    icc: bytes | None = None,
    exif: bytes | None = None,
    text: Mapping[str, str] | None = None,
    dpi: float | None = None,
) -> bytes:
    """The bytes of a picture file of `kind` (".png") of pixels [H, W, 3]; the rest as in `write_image`."""
    name = _FORMATS.get(kind.lower())
    if name is None:
        known = ", ".join(_FORMATS)
        raise UsageError(f"p3i writes no pictures of the kind {kind or '(no suffix)'!r}; it knows {known}")
    if alpha is not None and name not in _WITH_ALPHA:
        raise UsageError(f"{name} keeps no transparency: write PNG, TIFF or WebP")
    if text and name != "PNG":
        raise UsageError(f"{name} keeps no text that p3i could find again: write PNG")
    if bits not in (8, 16):
        raise UsageError(f"pictures are written with 8 or 16 bits, not {bits}")
    if bits == 16 and name not in _WITH_16_BITS:
        bits = 8
    array = _quantized(pixels, bits)
    if alpha is not None:
        array = np.concatenate([array, _quantized(alpha[:, :, None], bits)], axis=2)
    exif = upright_exif(exif, dpi=dpi) if exif else None
    if name == "PNG":
        return _png(array, icc=icc, exif=exif, text=text or {}, dpi=dpi)
    if bits == 16:
        return encode_tiff_16(array, icc=icc, exif=exif, dpi=dpi)
    picture = Pil.fromarray(array)
    options: dict[str, object] = {"quality": _JPEG_QUALITY} if name in ("JPEG", "WEBP") else {}
    if name == "TIFF" and not exif:  # libtiff, which compresses, writes no EXIF block and raises
        options["compression"] = "tiff_deflate"
    if icc and name != "BMP":
        options["icc_profile"] = icc
    if exif and name != "BMP":
        options["exif"] = exif
    if dpi and name in ("JPEG", "TIFF", "BMP"):
        options["dpi"] = (dpi, dpi)
    buffer = io.BytesIO()
    picture.save(buffer, name, **options)
    return buffer.getvalue()


def _png(
    array: np.ndarray, *, icc: bytes | None, exif: bytes | None, text: Mapping[str, str], dpi: float | None
) -> bytes:
    """A PNG of uint8 or uint16 [H, W, 3 or 4]; OpenCV packs the pixels, the other blocks are put in here."""
    data = _opencv_bytes(".png", array)
    chunks = b""
    if dpi:
        per_metre = round(dpi / 0.0254)
        chunks += _chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1))
    if icc:
        chunks += _chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(icc))
    if exif:
        chunks += _chunk(b"eXIf", exif.removeprefix(b"Exif\0\0"))
    for keyword, value in text.items():
        chunks += _chunk(b"iTXt", keyword.encode("latin-1") + b"\0\0\0\0\0" + value.encode("utf-8"))
    after_header = 8 + 25  # signature, then IHDR: 4 + 4 + 13 + 4 bytes
    return data[:after_header] + chunks + data[after_header:]


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def _opencv_bytes(suffix: str, array: np.ndarray) -> bytes:
    """The file that OpenCV makes of [H, W, 3 or 4] RGB(A)."""
    done, buffer = cv2.imencode(suffix, swap_red_blue(array))
    if not done:
        raise FileError(f"OpenCV could not encode a {array.shape[1]} x {array.shape[0]} {suffix} picture")
    return buffer.tobytes()


def _quantized(values: np.ndarray, bits: int) -> np.ndarray:
    """Float in 0..1, uint8 or uint16 [H, W, C] -> unsigned integers of `bits`, likewise."""
    if values.dtype == np.uint8:
        return values if bits == 8 else values.astype(np.uint16) * 257
    if values.dtype == np.uint16:
        return values if bits == 16 else ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)
    top = 2**bits - 1
    rounded = np.rint(np.clip(np.nan_to_num(values), 0, 1) * top)
    return rounded.astype(np.uint8 if bits == 8 else np.uint16)
