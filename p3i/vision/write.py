"""Pictures -> files: whole or not at all, and never over something that is there."""

import errno
import io
import os
import struct
import sys
import tempfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pil

from p3i.errors import FileError, UsageError
from p3i.vision.decode import swap_red_blue
from p3i.vision.exif import upright_exif

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


def write_bytes(path: str | os.PathLike[str], data: bytes, *, force: bool = False) -> None:
    """Write bytes to a file or standard output (`-`): whole or not at all, over nothing unless `force`.

    Raises FileError where the file exists (without `force`), is a folder, or cannot be written.
    """
    if os.fspath(path) == "-":
        sys.stdout.buffer.write(data)
        sys.stdout.buffer.flush()
        return
    target = Path(path)
    try:
        if target.is_dir():
            raise FileError(f"{target} is a folder: name a file in it")
        if target.exists() and not target.is_file():
            # A device or a pipe (/dev/null): there is nothing to replace, and a rename would destroy it.
            target.write_bytes(data)
        else:
            _write_beside_and_rename(target, data, force=force)
    except FileNotFoundError:
        raise FileError(f"there is no folder {target.parent} to write {target.name} into") from None
    except (OSError, ValueError) as error:  # ValueError: a name with a NUL in it
        reason = error.strerror if isinstance(error, OSError) else None
        raise FileError(f"{target} cannot be written: {reason or error}") from None


def _write_beside_and_rename(target: Path, data: bytes, *, force: bool) -> None:
    """Write a file in one step; FileError where it exists (without `force`), OSError as the system says."""
    place = target.resolve()  # through a link, so that the link stays one
    if not force and place.exists():
        raise FileError(f"{target} exists already: name another file, or say --force")
    handle, name = tempfile.mkstemp(prefix=f".{place.name[:40]}.", dir=place.parent)
    beside = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        beside.chmod(_mode_of(place))
        if force:
            beside.replace(place)
            return
        # A link fails where a file has appeared since; a rename would replace it.
        try:
            os.link(beside, place)
        except FileExistsError:
            raise FileError(f"{target} exists already: name another file, or say --force") from None
        except PermissionError:  # file systems without hard links say so
            beside.replace(place)
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
                raise
            beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)


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
    """The bytes of a picture file of `kind` (a suffix such as ".png"); the rest as in `write_image`."""
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
        return _tiff_16(array, icc=icc, dpi=dpi)
    picture = Pil.fromarray(array)
    options: dict[str, object] = {"quality": _JPEG_QUALITY} if name in ("JPEG", "WEBP") else {}
    if name == "TIFF":
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


def _tiff_16(array: np.ndarray, *, icc: bytes | None, dpi: float | None) -> bytes:
    """A plain one-strip TIFF of uint16 [H, W, 3 or 4]: Pillow and OpenCV write none with a profile."""
    height, width, channels = array.shape
    strip = np.ascontiguousarray(array.astype("<u2")).tobytes()
    short, long, rational, undefined = 3, 4, 5, 7
    tags: list[tuple[int, int, int, bytes]] = [
        (256, long, 1, struct.pack("<I", width)),
        (257, long, 1, struct.pack("<I", height)),
        (258, short, channels, struct.pack(f"<{channels}H", *[16] * channels)),
        (259, short, 1, struct.pack("<H", 1)),  # not compressed
        (262, short, 1, struct.pack("<H", 2)),  # RGB
        (273, long, 1, struct.pack("<I", 8)),  # the strip follows the header
        (277, short, 1, struct.pack("<H", channels)),
        (278, long, 1, struct.pack("<I", height)),
        (279, long, 1, struct.pack("<I", len(strip))),
    ]
    if dpi:
        per_inch = struct.pack("<II", round(dpi * 1000), 1000)
        tags += [(282, rational, 1, per_inch), (283, rational, 1, per_inch)]
        tags.append((296, short, 1, struct.pack("<H", 2)))  # inches
    if channels == 4:
        tags.append((338, short, 1, struct.pack("<H", 2)))  # the fourth channel is plain alpha
    if icc:
        tags.append((34675, undefined, len(icc), icc))
    directory_at = 8 + len(strip) + len(strip) % 2
    overflow_at = directory_at + 2 + 12 * len(tags) + 4
    entries, overflow = b"", b""
    for tag, kind, count, value in tags:
        if len(value) > 4:
            place = struct.pack("<I", overflow_at + len(overflow))
            overflow += value + b"\0" * (len(value) % 2)
        else:
            place = value.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, kind, count) + place
    head = b"II*\0" + struct.pack("<I", directory_at)
    directory = struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0)
    return head + strip + b"\0" * (len(strip) % 2) + directory + overflow


def _opencv_bytes(suffix: str, array: np.ndarray) -> bytes:
    done, buffer = cv2.imencode(suffix, swap_red_blue(array))
    if not done:
        raise FileError(f"OpenCV could not encode a {array.shape[1]} x {array.shape[0]} {suffix} picture")
    return buffer.tobytes()


def _quantized(values: np.ndarray, bits: int) -> np.ndarray:
    """Float in 0..1, uint8 or uint16 -> unsigned integers of `bits`."""
    if values.dtype == np.uint8:
        return values if bits == 8 else values.astype(np.uint16) * 257
    if values.dtype == np.uint16:
        return values if bits == 16 else ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)
    top = 2**bits - 1
    rounded = np.rint(np.clip(np.nan_to_num(values), 0, 1) * top)
    return rounded.astype(np.uint8 if bits == 8 else np.uint16)


def _mode_of(place: Path) -> int:
    """The permissions that the file has, or that a new one would get."""
    if place.exists():
        return place.stat().st_mode & 0o777
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
