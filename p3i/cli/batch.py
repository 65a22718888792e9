"""One input or many through one piece of work: each with its bar, its talk, its files and its own failure.

No failure of one input costs another: it is said, its exit code is kept, and the next one comes. An interrupt
ends the call, and what was written stays.
"""

import dataclasses
import json
import os
import re
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import IO, Any

import click

from p3i import files
from p3i.cli import progress, report
from p3i.cli.targets import STDOUT, Targets
from p3i.errors import FileError, P3IError

Update = Callable[[str, float], None]

SOME_FAILED = 6
"""The exit code where inputs came out differently."""

INTERRUPTED = 130


@dataclasses.dataclass(frozen=True, slots=True)
class Made:
    """The bytes of a file, and what is to be said of it."""

    data: bytes
    notes: Sequence[str] = ()


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What came of one input.

    `make` makes its file, `facts` its JSON; neither is called where nobody asked for it. `notes` and `info`
    are sentences for stderr, `more` those that -v asks for. `code` is 0, or that of a check that says no: the
    answer is written all the same.
    """

    make: Callable[[], Made]
    facts: Callable[[], Mapping[str, Any]]
    notes: Sequence[str] = ()
    info: Sequence[str] = ()
    more: Sequence[str] = ()
    code: int = 0
    refusal: str = ""
    """The sentence that goes with `code`."""


Work = Callable[[str, Update], Answer]
"""The work on one input: its name, and where it says how far it is."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Talk:
    """How a call speaks on stderr."""

    quiet: bool
    verbose: bool
    as_json: bool

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Talk":
        """What -q, -v and --error-format mean."""
        return cls(
            quiet=given["quiet"], verbose=given["verbose"] > 0, as_json=given["error_format"] == "json"
        )

    def say(self, sentences: Iterable[str], *, name: str, kind: str = "note") -> None:
        """Say sentences about an input, unless asked to be quiet."""
        for sentence in () if self.quiet else sentences:
            message = sentence if self.as_json else f"{files.spoken(name)}: {sentence}"
            report.line(message, as_json=self.as_json, kind=kind, image=name)

    def refuse(self, sentence: str, *, name: str, code: int) -> int:
        """Say what is wrong with an input; returns the exit code."""
        shown = files.spoken(name)
        message = sentence if self.as_json or shown in sentence else f"{shown}: {sentence}"
        report.line(message, as_json=self.as_json, code=code, image=name)
        return code


def exit_code(codes: Iterable[int]) -> int:
    """The exit code of a call from those of its inputs.

    The code that all have; 6 where they differ; 130 once one was interrupted; 0 where there are none.
    """
    kinds = set(codes)
    if INTERRUPTED in kinds:
        return INTERRUPTED
    return kinds.pop() if len(kinds) == 1 else SOME_FAILED if kinds else 0


def run(inputs: Sequence[str], work: Work, *, to: Targets, talk: Talk) -> int:
    """Work through the inputs in order, write each answer as soon as it is known, return the exit code."""
    codes: list[int] = []
    with ExitStack() as opened:
        answers = _Stream.of(to.answers, shared=to.answers_in_one, force=to.force, opened=opened)
        facts = _Stream.of(to.facts, shared=to.facts_in_one, force=to.force, opened=opened)

        def finish(number: int) -> int:
            name, answer_to, facts_to = inputs[number], to.answers[number], to.facts[number]
            label = Path(files.spoken(name)).name
            label = label if len(inputs) == 1 else f"{number + 1}/{len(inputs)} {label}"
            with progress.bar(label, wanted=not talk.quiet) as update:
                answer = work(name, update)
                update("writing", 1.0)
                made = None if answer_to is None else answer.make()
                record = None if facts_to is None else answer.facts()
            talk.say(answer.notes, name=name)
            if made is not None:
                talk.say(made.notes, name=name)
                answers.write(answer_to, made.data)
            if record is not None:
                facts.write(facts_to, _facts(record, name, in_one=to.facts_in_one))
            talk.say((*answer.info, *(answer.more if talk.verbose else ())), name=name, kind="info")
            return talk.refuse(answer.refusal, name=name, code=answer.code) if answer.code else 0

        for number, name in enumerate(inputs):
            code, wrong = guarded(partial(finish, number), name=name, talk=talk)
            if wrong and to.facts_in_one:
                facts.write(to.facts[number], _facts({"error": wrong, "code": code}, name, in_one=True))
            codes.append(code)
            if code == INTERRUPTED:
                break
    return exit_code(codes)


def guarded(attempt: Callable[[], int], *, name: str, talk: Talk) -> tuple[int, str]:
    """The exit code of what is done for one input, and the sentence where it failed, which is said.

    Nothing that goes wrong comes out, but a standard output that takes no more: no later answer would fare
    better.
    """
    try:
        return attempt(), ""
    except BrokenPipeError:  # OutputError too
        raise
    except KeyboardInterrupt:
        return talk.refuse("interrupted", name=name, code=INTERRUPTED), ""
    except P3IError as error:
        return _refused(error, name=name, talk=talk), str(error)
    except OSError as error:  # what the system refuses where nobody foresaw it
        wrong = (error.strerror or str(error)).lower()
        return talk.refuse(wrong, name=name, code=FileError.exit_code), wrong
    except MemoryError:
        wrong = "not enough memory for this picture; scale it down"
        return talk.refuse(wrong, name=name, code=FileError.exit_code), wrong
    except Exception as error:
        if os.environ.get("P3I_DEBUG"):
            traceback.print_exception(error)
        wrong = report.bug_sentence(error)
        return talk.refuse(wrong, name=name, code=70), wrong


def facts_text(facts: Mapping[str, Any]) -> str:
    """JSON with one key a line; rows of numbers stay on theirs."""
    text = json.dumps(facts, indent=2)
    rows = re.compile(r"\[[^\[\]{}]*\]")
    return rows.sub(lambda row: "[" + ", ".join(re.split(r",\s+", row[0][1:-1].strip())) + "]", text) + "\n"


def _facts(record: Mapping[str, Any], name: str, *, in_one: bool) -> bytes:
    """The facts of an input: a line that names it, where there are several in one file."""
    if not in_one:
        return facts_text(record).encode("utf-8")
    named = {"image": name} | dict(record) | {"image": name}
    return f"{json.dumps(named)}\n".encode()


def _refused(error: P3IError, *, name: str, talk: Talk) -> int:
    from p3i.grammar.parse_error import ParseError  # read here, so that `--help` does not

    if isinstance(error, ParseError):
        return report.p3i_error(error, as_json=talk.as_json)
    return talk.refuse(str(error), name=name, code=error.exit_code)


@dataclasses.dataclass(frozen=True, slots=True)
class _Stream:
    """Where answers are written: each to its place, or all to `shared`, one file that stays open."""

    shared: IO[str] | None
    force: bool

    @classmethod
    def of(cls, places: Sequence[str | None], *, shared: bool, force: bool, opened: ExitStack) -> "_Stream":
        """Opens the file that all share, if it is one."""
        place = places[0] if shared and places else None
        if place is None or place == STDOUT:
            return cls(None, force)
        return cls(opened.enter_context(files.replacing(Path(place), force=force)), force)

    def write(self, place: str | None, data: bytes) -> None:
        """Write one answer; raises FileError."""
        if self.shared is not None:
            self.shared.write(data.decode("utf-8"))
            self.shared.flush()
        elif place == STDOUT:
            click.echo(data, nl=False)
        elif place is not None:
            files.write_bytes(place, data, force=self.force)
