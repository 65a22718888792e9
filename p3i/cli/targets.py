"""Where the answers of a command go: the rule of `-o`, `--format`, `--json` and `--force`, for every command.

- `-o FILE` is for one answer, whose kind its suffix tells, unless `--format` does.
- `-o DIR/` (a slash at the end, or a folder that exists) gets a file for each input: its name with the ending
  of the kind, after its own suffix where two inputs would else become one file. The folder is made.
- `-o -`, or none, is stdout. Several answers need a folder, unless they are lines of text.
- `--json FILE` gets the facts as a JSON object, one a line where there are several inputs; `DIR/` one file
  each; `-` is stdout, and then nothing else is made unless -o names a place for it.
- No file that exists is written over without `--force`, none that is read here at all. All of it is known
  before the work begins.
"""

import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from p3i import files
from p3i.cli import grouped, options
from p3i.errors import UsageError

STDOUT = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinds:
    """What a command can write: the kinds by the suffix that asks for them, the first being the default.

    `asked` are kinds that no suffix tells; `endings` those of kinds whose files do not end in `.kind`. `text`
    are the kinds that may be read on a terminal, `lines` those whose answers can follow one another.
    """

    by_suffix: Mapping[str, str]
    asked: tuple[str, ...] = ()
    endings: Mapping[str, str] = field(default_factory=dict)
    text: frozenset[str] = frozenset()
    lines: frozenset[str] = frozenset()
    what: str = "kind of picture"

    @property
    def all(self) -> tuple[str, ...]:
        """Every kind, once, in order."""
        return tuple(dict.fromkeys((*self.by_suffix.values(), *self.asked)))

    def of(self, output: str | None, asked: str | None) -> str:
        """The kind of the answer; raises UsageError where the name of the file does not tell it."""
        if asked is not None:
            return asked
        if output is None or files.names_folder(output):
            return self.all[0]
        suffix = Path(output).suffix.lower()
        if suffix not in self.by_suffix:
            if files.is_stream(output):
                return self.all[0]
            known = ", ".join(self.by_suffix)
            more = ", or say --format" if self.asked else ""
            raise UsageError(f"cannot tell the {self.what} from {output!r}: end the name in {known}{more}")
        return self.by_suffix[suffix]

    def ending(self, kind: str) -> str:
        """How a file of a kind ends."""
        return self.endings.get(kind, f".{kind}")


def written(kinds: Kinds, sentence: str) -> grouped.Decorator:
    """The options `-o`, `--format`, `--json` and `--force`; `sentence` says what is written."""
    return grouped.group(
        "Output",
        options.output(
            f"{sentence} The suffix tells the kind; - is stdout, DIR/ gets a file for each input."
        ),
        click.option(
            "--format",
            "kind",
            type=click.Choice(kinds.all),
            default=None,
            help=f"The {kinds.what}. [default: by the name of -o, else {kinds.all[0]}]",
        ),
        click.option(
            "--json",
            "json_to",
            metavar="FILE|DIR|-",
            default=None,
            help="Write the facts as JSON, of several inputs an object a line; - is stdout.",
        ),
        options.force,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Targets:
    """Where each input's answer and facts go: a file, - for stdout, or None where neither is wanted.

    `answers_in_one`, `facts_in_one`: several inputs share that one place, one after another.
    """

    kind: str
    answers: tuple[str | None, ...]
    facts: tuple[str | None, ...]
    answers_in_one: bool
    facts_in_one: bool
    force: bool


def targets(
    given: Mapping[str, Any], *, inputs: Sequence[str], kinds: Kinds, read: Iterable[str | None] = ()
) -> Targets:
    """What the options of `written` mean for `inputs`; `read` are other files that the call reads.

    Raises UsageError and FileError for all that could not be written later; makes the folders.
    """
    output: str | None = given["output"]
    facts: str | None = given["json_to"]
    if len(inputs) > 1 and output is not None and not (kinds.lines or _is_folder(output)):
        raise UsageError(f"{len(inputs)} inputs need -o FOLDER/, with a slash at its end")
    kind = kinds.of(output, given["kind"])
    wanted = output or (None if facts == STDOUT else STDOUT)
    several = len(inputs) > 1
    in_lines = several and kind in kinds.lines
    if several and wanted is not None and not (in_lines or _is_folder(wanted)):
        raise UsageError(f"{len(inputs)} inputs need -o FOLDER/")
    if wanted == STDOUT and kind not in kinds.text and sys.stdout.isatty():
        raise UsageError(f"a {kind.upper()} file does not belong on a terminal: name a file with -o")
    found = Targets(
        kind=kind,
        answers=_places(wanted, inputs, kinds.ending(kind)),
        facts=_places(facts, inputs, ".json"),
        answers_in_one=in_lines and wanted is not None and not _is_folder(wanted),
        facts_in_one=several and facts is not None and not _is_folder(facts),
        force=given["force"],
    )
    _refuse_clashes(found, taken=[*inputs, *read])
    for place in (wanted, facts):
        if place is not None and _is_folder(place):
            files.make_folder(Path(place))
    for place in _files(found):
        files.check_writable(Path(place), force=found.force)
    return found


def names(inputs: Sequence[str], ending: str) -> list[str]:
    """The names of the files that inputs become: a.jpg is a.png, where there is no a.webp too.

    Raises UsageError where two would be one all the same.
    """
    stems = Counter(map(_stem, inputs))
    found = [(_stem(each) if stems[_stem(each)] == 1 else Path(each).name) + ending for each in inputs]
    if twice := [name for name, count in Counter(found).items() if count > 1]:
        raise UsageError(f"two inputs would both be written to {twice[0]}")
    return found


def _stem(path: str) -> str:
    return "stdin" if path == STDOUT else Path(path).stem or Path(path).name


def _is_folder(place: str) -> bool:
    return place != STDOUT and files.names_folder(place)


def _places(place: str | None, inputs: Sequence[str], ending: str) -> tuple[str | None, ...]:
    if place is None or not _is_folder(place):
        return (place,) * len(inputs)
    return tuple(str(Path(place) / name) for name in names(inputs, ending))


def _files(found: Targets) -> list[str]:
    """The files that will be written, as many times as they would be."""
    answers = found.answers[:1] if found.answers_in_one else found.answers
    facts = found.facts[:1] if found.facts_in_one else found.facts
    return [place for place in (*answers, *facts) if place not in (None, STDOUT)]


def _refuse_clashes(found: Targets, *, taken: Iterable[str | None]) -> None:
    """Raise UsageError for a file that would be written twice, or is read here."""
    written: set[object] = set()
    read = {files.place_of(path) for path in taken if path is not None and path != STDOUT}
    for name in _files(found):
        place = files.place_of(name)
        if place in written:
            raise UsageError(f"answer and facts would both be written to {name}")
        if place in read:
            raise UsageError(f"{name} is read here: write to another file")
        written.add(place)
