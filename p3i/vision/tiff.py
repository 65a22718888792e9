"""TIFF of 16 bits a channel, which Pillow does not write: by tifffile, or, without that extra, by OpenCV.

OpenCV writes the pixels alone. tifffile writes the profile, the resolution and the text that a camera left as
well; the camera's own tables (EXIF and GPS), which it leaves out, are put behind its file here.
"""

import importlib.util
import io
import struct
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from PIL import Image as Pil
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from p3i.errors import FileError
from p3i.vision.decode import swap_red_blue

# tag: what stands in its place until its table is written. tifffile keeps both tags for itself; the numbers
# just below are nobody's, and leave the tags in their order.
_TABLES = {0x8769: 0x8768, 0x8825: 0x8824}  # EXIF, GPS
_PROFILE = 34675
_ASCII, _LONG, _UNDEFINED = 2, 4, 7
_DEFLATE = 8
# Offsets of a plain TIFF have 32 bits; beyond, and a little before, a file is BigTIFF, without such tables.
_LARGEST_PLAIN = 2**32 - 2**25


def has_tifffile() -> bool:
    """Whether the extra `tiff` is installed."""
    return importlib.util.find_spec("tifffile") is not None


def encode_tiff_16(
    array: np.ndarray, *, icc: bytes | None = None, exif: bytes | None = None, dpi: float | None = None
) -> bytes:
    """A deflated TIFF of uint16 [H, W, 3 or 4] RGB, the fourth channel plain alpha.

    `exif` is a raw block that says upright already. Without tifffile the file holds the pixels alone.
    Raises FileError where OpenCV cannot encode them.
    """
    if not has_tifffile():
        how = [cv2.IMWRITE_TIFF_COMPRESSION, _DEFLATE]
        done, buffer = cv2.imencode(".tiff", swap_red_blue(array), how)
        if not done:
            raise FileError(f"OpenCV could not encode a {array.shape[1]} x {array.shape[0]} TIFF of 16 bits")
        return buffer.tobytes()
    import tifffile

    block = Pil.Exif()
    if exif:
        block.load(exif)
    plain = array.nbytes < _LARGEST_PLAIN
    tables = {tag: block.get_ifd(tag) for tag in _TABLES if plain and tag in block}
    extra: list[tuple[int, int, int, Any, bool]] = [
        (tag, _ASCII, 0, text, True)
        for tag, text in block.items()
        if isinstance(text, str) and text.isascii() and tag not in _TABLES
    ]
    extra += [(_TABLES[tag], _LONG, 1, 0, True) for tag in tables]
    if icc:
        extra.append((_PROFILE, _UNDEFINED, len(icc), icc, True))
    stream = io.BytesIO()
    tifffile.imwrite(
        stream,
        array,
        bigtiff=not plain,
        byteorder="<",
        compression="zlib",
        predictor=True,
        photometric="rgb",
        extrasamples=["unassalpha"] if array.shape[2] == 4 else None,
        resolution=(dpi, dpi) if dpi else None,
        resolutionunit="INCH" if dpi else None,
        metadata=None,
        software=False,
        extratags=extra,
    )
    if tables:
        stream.seek(0)
        with tifffile.TiffFile(stream) as file:
            entries = {tag: file.pages[0].tags[_TABLES[tag]].offset for tag in tables}  # pyright: ignore
        _append(stream, tables, entries)
    return stream.getvalue()


def _append(stream: io.BytesIO, tables: Mapping[int, Mapping[int, Any]], entries: Mapping[int, int]) -> None:
    """Put tables of tags behind a plain TIFF, and their places into the entries at these offsets."""
    for tag, table in tables.items():
        at = stream.seek(0, io.SEEK_END)
        if at % 2:
            at += stream.write(b"\0")
        directory = ImageFileDirectory_v2()  # little-endian, as the file
        for inner, value in table.items():
            directory[inner] = value
        stream.write(directory.tobytes(at))
        stream.seek(entries[tag])
        stream.write(struct.pack("<HHII", tag, _LONG, 1, at))
