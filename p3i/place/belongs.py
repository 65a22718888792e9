"""Whether a program was made for the photo at hand, by what its header says of the photo that it is of.

Imports no heavy package: it is asked about every photo that comes with a program.
"""

import re
from pathlib import PurePath

from p3i.grammar.ast import Program
from p3i.size import Size

_SHAPE = 0.01
"""Canvases whose proportions differ by no more than this are one photo in two sizes, or hardly cut."""


def doubt(program: Program, size: Size, name: str | None) -> str | None:
    """A sentence where the header of `program` names another photo than this; None where it does not.

    `size` is the photo's, `name` its file's, None where it has none. A canvas of the same proportions is the
    same photo in another size; a name that goes on after the other's, such as `wall-filled.png` after
    `wall.jpg`, is the same photo worked on.
    """
    header = program.header
    if header is None:
        return None
    made_for = PurePath(header.image.replace("\\", "/")).name if header.image else None
    other = made_for is not None and name is not None and not _akin(made_for, PurePath(name).name)
    canvas = header.canvas
    if canvas is not None:
        apart = abs(canvas[0] * size.height - canvas[1] * size.width)
        if apart > _SHAPE * max(canvas[0] * size.height, canvas[1] * size.width):
            whose = f" of {made_for}" if other else ""
            return (
                f"this is not the photo that the program was made for: its canvas{whose} of {canvas[0]} x "
                f"{canvas[1]} has not the shape of this photo of {size.width} x {size.height}, so that its "
                "objects lie elsewhere"
            )
    if other and name is not None:
        return (
            f"the program was made for {made_for}, and this is {PurePath(name).name}: unless both show the "
            "same view its objects lie elsewhere"
        )
    return None


def _akin(first: str, second: str) -> bool:
    """Whether a name is the other's, or goes on after it."""
    short, long = sorted((PurePath(first).stem.casefold(), PurePath(second).stem.casefold()), key=len)
    return bool(short) and (short == long or re.match(rf"{re.escape(short)}[^0-9a-z]", long) is not None)
