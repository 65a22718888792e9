"""Where the answers of a command go that takes one input or many: a file, stdout, or files in a folder."""

from collections.abc import Sequence
from pathlib import Path

from p3i import files
from p3i.errors import UsageError


def targets(output: str, names: Sequence[str], *, into_folder: bool, clash: str, force: bool) -> list[str]:
    """The file of each answer, or - for stdout, known to be writable; a folder is made.

    `output` is a file, or - for stdout, or a folder where `into_folder`: then `names` are those of the files
    in it. Raises UsageError, beginning with `clash`, where two would be one file, FileError for what cannot
    be written.
    """
    if not into_folder:
        found = [output]
    else:
        if twice := [name for name in names if names.count(name) > 1]:
            raise UsageError(f"{clash} {Path(output) / twice[0]}")
        found = [str(Path(output) / name) for name in names]
        files.make_folder(Path(output))
    for target in found:
        if target != "-":
            files.check_writable(Path(target), force=force)
    return found
