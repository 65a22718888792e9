"""The one table of the pictures that are written: what a name's suffix asks for. Free of heavy imports."""

from os import PathLike, fspath
from pathlib import Path

from p3i.errors import UsageError

BY_SUFFIX = {".png": "png", ".jpg": "jpg", ".jpeg": "jpg", ".tif": "tiff", ".tiff": "tiff", ".webp": "webp"}
"""The kind of picture that each suffix asks for."""

PICTURE_KINDS = tuple(dict.fromkeys(BY_SUFFIX.values()))
"""The kinds, each once."""

LOSSY = frozenset({"jpg", "webp"})
"""The kinds that store every pixel anew."""


def picture_kind(path: str | PathLike[str]) -> str:
    """The kind of picture that a name asks for; raises UsageError for one that is not written."""
    suffix = Path(path).suffix.lower()
    if suffix not in BY_SUFFIX:
        known = ", ".join(BY_SUFFIX)
        raise UsageError(f"cannot tell the kind of picture from {fspath(path)!r}: end the name in {known}")
    return BY_SUFFIX[suffix]
