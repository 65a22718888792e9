"""The words that a PNG file holds beside its pixels, however they are packed."""

import io

from PIL.PngImagePlugin import PngImageFile

_MOST_PX = 200_000_000
"""Text behind the pixels is looked for in pictures of up to so many: it takes decoding them."""


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
    if found or width * height > _MOST_PX:
        return found
    try:
        return {str(key): str(value) for key, value in picture.text.items()}
    except Exception:
        return found
