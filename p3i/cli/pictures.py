"""What the commands share that take a photo with its program and write a picture: options, talk, output."""

import dataclasses
import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from p3i import files
from p3i.cli import report
from p3i.cli.options import Decorator
from p3i.errors import UsageError
from p3i.paint.rectify_options import PICTURE_KINDS

if TYPE_CHECKING:
    from p3i.paint.picture import Picture

_SUFFIXES = {f".{kind}": kind for kind in PICTURE_KINDS} | {".jpeg": "jpg", ".tif": "tiff"}

kind_option: Decorator = click.option(
    "--format",
    "kind",
    type=click.Choice(PICTURE_KINDS),
    default=None,
    help="The kind of picture. [default: by the name of -o, else png]",
)
"""`--format png|jpg|tiff|webp`."""

json_option: Decorator = click.option(
    "--json", "json_to", metavar="FILE|-", default=None, help="Write the facts as JSON; - is stdout."
)
"""`--json FILE|-`; to stdout no picture is made, unless -o names a file for it."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """Where a picture and its facts go, known before any work: `picture`, `facts` are files, - or None."""

    picture: str | None
    kind: str
    facts: str | None
    force: bool
    quiet: bool
    as_json: bool

    @classmethod
    def of(cls, given: dict[str, Any], *, inputs: Iterable[str | None] = ()) -> "Outputs":
        """What the shared options mean; raises UsageError or FileError for what cannot be written."""
        output: str | None = given["output"]
        facts: str | None = given["json_to"]
        kind: str | None = given["kind"]
        if output is not None and files.names_folder(output):
            raise UsageError(f"{output} is a folder: name a file in it")
        if kind is None:
            suffix = ".png" if output is None else Path(output).suffix.lower()
            if suffix not in _SUFFIXES:
                known = ", ".join(_SUFFIXES)
                raise UsageError(f"cannot tell the kind of picture from {output!r}: end the name in {known}")
            kind = _SUFFIXES[suffix]
        picture = output or (None if facts == "-" else "-")
        if picture == "-" and sys.stdout.isatty():
            raise UsageError(f"a {kind.upper()} picture does not belong on a terminal: name a file with -o")
        for path in (picture, facts):
            if path not in (None, "-"):
                files.check_writable(Path(str(path)), force=given["force"])
        named = [path for path in (picture, facts) if path is not None and path != "-"]
        written = {files.place_of(path): path for path in named}
        if len(written) < len(named):
            raise UsageError(f"picture and facts would both be written to {named[0]}")
        taken = {files.place_of(word) for word in inputs if word is not None and word != "-"}
        if clash := [path for place, path in written.items() if place in taken]:
            raise UsageError(f"{clash[0]} is read here: write to another file")
        return cls(
            picture=picture,
            kind=kind,
            facts=facts,
            force=given["force"],
            quiet=given["quiet"],
            as_json=given["error_format"] == "json",
        )

    def write(self, picture: "Picture | None", facts: dict[str, Any], *, name: str) -> None:
        """Write both, the picture first; say what the kind of file loses."""
        if picture is not None and self.picture is not None:
            self.say(picture.notes(self.kind), name=name)
            picture.save(self.picture, kind=self.kind, force=self.force)
        if self.facts is None:
            return
        text = facts_text(facts)
        if self.facts == "-":
            click.echo(text.encode("utf-8"), nl=False)
            return
        with files.replacing(Path(self.facts), force=self.force) as stream:
            stream.write(text)

    def say(self, sentences: Iterable[str], *, name: str, kind: str = "note") -> None:
        """Say sentences on stderr, unless asked to be quiet."""
        if not self.quiet:
            for sentence in sentences:
                message = sentence if self.as_json else f"{name}: {sentence}"
                report.line(message, as_json=self.as_json, kind=kind, image=name)


def facts_text(facts: dict[str, Any]) -> str:
    """JSON with one key a line; rows of numbers stay on theirs."""
    text = json.dumps(facts, indent=2)
    rows = re.compile(r"\[[^\[\]{}]*\]")
    return rows.sub(lambda row: "[" + ", ".join(re.split(r",\s+", row[0][1:-1].strip())) + "]", text) + "\n"
