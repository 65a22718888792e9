"""The list of objects as users hold it: all that was found, and the files that it becomes."""

import dataclasses
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from p3i.export.crops import write_crops
from p3i.export.formats import encode
from p3i.export.table import record
from p3i.files import write_bytes
from p3i.options.points import format_of
from p3i.place.objects import Objects


@dataclass(frozen=True, slots=True, eq=False)
class Listing(Objects):
    """Objects that can be written as files."""

    @classmethod
    def of(cls, found: Objects) -> "Listing":
        """The same objects, to be written."""
        return cls(**{field.name: getattr(found, field.name) for field in dataclasses.fields(Objects)})

    def record(self) -> dict[str, Any]:
        """All that is known, as the format `json` and `--json` have it."""
        return record(self)

    def encode(self, form: str) -> bytes:
        """The list as a file of the format `form` (FORMATS of the options); UsageError for another one."""
        return encode(self, form)

    def save(self, path: str | PathLike[str], *, form: str | None = None, force: bool = False) -> None:
        """Write a file, whole or not at all, its format by the suffix unless `form` says; `-` is stdout.

        Raises UsageError for an unknown format, FileError where the file exists (without `force`) or cannot
        be written.
        """
        write_bytes(path, self.encode(form or format_of(path)), force=force)

    def write_crops(
        self, folder: str | PathLike[str], *, straight: bool = True, force: bool = False
    ) -> tuple[Path, ...]:
        """Write a picture of each object into `folder`, by its name (crops.py)."""
        return write_crops(self, folder, straight=straight, force=force)
