"""The words that a PNG file holds beside its pixels, however they are packed."""

import io
import struct

from PIL.PngImagePlugin import PngImageFile

_MOST_PX = 200_000_000
"""Text behind the pixels is looked for in pictures of up to so many: it takes decoding them."""
_TEXT = (b"tEXt", b"zTXt", b"iTXt")


def png_text(data: bytes) -> dict[str, str]:
    """The text entries (tEXt, zTXt, iTXt) of a PNG file's bytes, keyword -> text; never raises.

    Of a file that is damaged, what stands before the damage; empty for bytes that are no PNG.
    """
    try:
        picture = PngImageFile(io.BytesIO(data))
    except Exception:  # Pillow's readers raise what they like for damaged files
        return {}
    found = {str(key): str(value) for key, value in picture.info.items() if isinstance(value, str)}
    width, height = picture.size
    if width * height > _MOST_PX or not _text_behind_pixels(data):
        return found
    try:
        return found | {str(key): str(value) for key, value in picture.text.items()}
    except Exception:
        return found


def _text_behind_pixels(data: bytes) -> bool:
    """Whether a text entry follows the first pixels: then Pillow has to read all of them to come to it."""
    at, pixels = 8, False
    while at + 8 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        if pixels and kind in _TEXT:
            return True
        pixels = pixels or kind == b"IDAT"
        at += 12 + length
    return False
