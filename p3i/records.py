"""Records of options, as the Python API and the command line both read them: a leaf, free of heavy imports.

A record is a frozen dataclass whose fields are Annotated with the sentence that documents them, so `--help`
and `help(...)` cannot differ.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Annotated, Any, TypeVar, get_type_hints

from p3i.errors import UsageError

Record = TypeVar("Record")

PhotoFocal = Annotated[
    float | None,
    "35 mm-equivalent focal length; by default that of the program's header, else of the photo, else 35.",
]
"""The field `focal_mm` of every record for a program on its photo."""


def told(record: type) -> tuple[Callable[[str], str], Callable[[str], Any]]:
    """What documents a field of a record, and its default: two functions of its name.

    Both raise KeyError for a name that is no field.
    """

    def sentence(name: str) -> str:
        return get_type_hints(record, include_extras=True)[name].__metadata__[0]

    def default(name: str) -> Any:
        return {field.name: field.default for field in dataclasses.fields(record)}[name]

    return sentence, default


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
