"""Records of options, as the Python API and the command line both read them: a leaf, free of heavy imports.

A record is a frozen dataclass whose fields are Annotated with the sentence that documents them, so `--help`
and `help(...)` cannot differ. Name, type, default and sentence of a field are all that the command line needs
(`p3i.cli.options.of`); where it spells a field otherwise, a `Spelt` stands beside the sentence.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from functools import cache
from typing import Annotated, Any, TypeVar, get_type_hints

from p3i.errors import UsageError

Record = TypeVar("Record")


@dataclasses.dataclass(frozen=True, slots=True)
class Spelt:
    """How the command line spells a field, where that does not follow from its name and type.

    `flags` as click declares them: "--from", or "--even-light/--keep-light"; empty means by the field's name.
    `metavar` stands for the value in `--help`. `read` makes the value of its text, and raises UsageError or
    ValueError: for types that the command line does not know by itself. `none` is a word that means None.
    """

    flags: str = ""
    metavar: str | None = None
    read: Callable[[str], Any] | None = None
    none: str | None = None


@dataclasses.dataclass(frozen=True, slots=True)
class Field:
    """One field of a record of options: its type without the Annotated, its default, what documents it."""

    name: str
    kind: Any
    default: Any
    sentence: str
    spelt: Spelt


PhotoFocal = Annotated[
    float | None,
    "35 mm-equivalent focal length; by default that of the program's header, else of the photo, else 35.",
    Spelt("--focal", metavar="MM"),
]
"""The field `focal_mm` of every record for a program on its photo."""

KeepTransparent = Annotated[
    bool,
    "Leave what is transparent as it is; by default the pattern goes on there.",
    Spelt("--keep-transparent"),
]
"""The field `keep_transparent` of the records that take holes in a photo for hidden ground."""


@cache
def fields_of(record: type) -> Mapping[str, Field]:
    """The documented fields of a record by name, in its order."""
    hints = get_type_hints(record, include_extras=True)
    found = {}
    for field in dataclasses.fields(record):
        sentence, *more = hints[field.name].__metadata__
        spelt = next((one for one in more if isinstance(one, Spelt)), Spelt())
        found[field.name] = Field(field.name, hints[field.name].__origin__, field.default, sentence, spelt)
    return found


def changed(options: Record, changes: Mapping[str, Any], *, verb: str) -> Record:
    """`options` with the fields of `changes`; raises UsageError for a field that it does not have."""
    known = {field.name for field in dataclasses.fields(options)}  # pyright: ignore[reportArgumentType]
    if unknown := sorted(changes.keys() - known):
        raise UsageError(f"{verb} has no option {unknown[0]!r}; it has {', '.join(sorted(known))}")
    return dataclasses.replace(options, **changes) if changes else options  # pyright: ignore


def check_focal(focal_mm: float | None) -> None:
    """Raise UsageError for a focal length (mm) out of range; None is none stated."""
    if focal_mm is not None and not (math.isfinite(focal_mm) and 1 <= focal_mm <= 10_000):
        raise UsageError(f"a focal length lies between 1 and 10000 mm, not {focal_mm:g}")


def check_max_px(max_px: int) -> None:
    """Raise UsageError for a limit of pixels that no picture keeps to."""
    if max_px < 1:
        raise UsageError(f"the limit of pixels must be at least 1, not {max_px}")
