"""One photo of `p3i synth`: searched, and its answer put into words. What fails for it fails in here."""

import dataclasses
import json
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from p3i import api
from p3i.cli import report
from p3i.errors import NoPatternError, P3IError
from p3i.search.config import SearchConfig
from p3i.search.result import StopReason, SynthesisResult

Note = Callable[[str], object]
"""Takes a step of a search, as a line of JSON."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A photo, and all that its search and its answer depend on; goes to other processes."""

    photo: Path
    config: SearchConfig
    mask: str | None = None
    roi: api.Polygon | None = None
    max_px: int | None = None
    beside: Path | None = None
    """The folder as seen from which the program's header names the photo."""
    as_record: bool = False
    """Whether the answer is a JSON object instead of texts."""
    every: bool = False
    """Whether every pattern of the photo is asked for."""
    raises_bugs: bool = False
    """Whether what nobody foresaw is raised: where no other photo would suffer."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of one photo: a result with its time, or an error with its exit code.

    `more` are the results for further patterns of the photo, where every one is asked for. `texts` are the
    programs of the result and of the other candidates, or patterns, that were asked for, the best first;
    `records` is what `--format jsonl` prints, a line each, an error included.
    """

    photo: Path
    result: SynthesisResult | None = None
    more: tuple[SynthesisResult, ...] = ()
    texts: tuple[str, ...] = ()
    records: tuple[Mapping[str, Any], ...] = ()
    error: str = ""
    code: int = 0
    seconds: float = 0.0


def prepare() -> None:
    """Load what the search needs, torch above all, before the first photo's clock starts."""
    import p3i.search.synthesize  # noqa: F401


def solve(task: Task, *, update: api.Progress, note: Note | None = None) -> Outcome:
    """Synthesize one photo; every failure but a closed pipe becomes an Outcome, so a batch goes on.

    `note` is given each step of the search.
    """

    def trace(step: Mapping[str, Any]) -> None:
        if note is not None:
            note(json.dumps({"image": str(task.photo), **step}, default=_plain) + "\n")

    begun = time.perf_counter()
    seconds: float | None = None
    try:
        search = _every if task.every else _one
        result, *more = search(
            task.photo,
            task.config,
            mask=task.mask,
            roi=task.roi,
            max_px=task.max_px,
            beside=task.beside,
            progress=update,
            trace=None if note is None else trace,
        )
        seconds = time.perf_counter() - begun
        if result.program is not None:
            return _answer(task, result, tuple(more), seconds=seconds)
        code = 130 if result.stop is StopReason.INTERRUPTED else NoPatternError.exit_code
        return failure(task, result.reason, code=code, seconds=seconds)
    except KeyboardInterrupt:
        error, code = StopReason.INTERRUPTED.value, 130
    except BrokenPipeError:
        raise
    except P3IError as failed:
        error, code = str(failed), failed.exit_code
    except MemoryError:
        error, code = "not enough memory for this photo; scale it down", 3
    except Exception as failed:
        if task.raises_bugs:
            raise
        error, code = report.bug_sentence(failed), 70
    return failure(task, error, code=code, seconds=seconds or time.perf_counter() - begun)


def failure(task: Task, error: str, *, code: int, seconds: float = 0.0) -> Outcome:
    """The outcome of a photo without an answer: the sentence that says why, and its exit code."""
    name = str(task.photo)
    record = {"image": name, "program": None, "error": error, "code": code, "seconds": round(seconds, 3)}
    return Outcome(
        photo=task.photo,
        records=(record,) if task.as_record else (),
        error=error,
        code=code,
        seconds=seconds,
    )


def _one(photo: Path, config: SearchConfig, **given: Any) -> tuple[SynthesisResult, ...]:
    return (api.synth(photo, config, **given),)


def _every(photo: Path, config: SearchConfig, **given: Any) -> tuple[SynthesisResult, ...]:
    return api.synth_all(photo, config, **given)


def _answer(
    task: Task, result: SynthesisResult, more: tuple[SynthesisResult, ...], *, seconds: float
) -> Outcome:
    """Results with programs, put into words. Raises ParseError for one that has none in its layout."""
    from p3i.grammar.printer import format_program

    results = (result, *more)
    code = 130 if results[-1].stop is StopReason.INTERRUPTED else 0
    texts, records = (), ()
    if task.as_record:
        records = tuple(one.record(image=str(task.photo), seconds=seconds) for one in results)
        if task.every:
            records = tuple(
                {**record, "pattern": number, "patterns": len(records)}
                for number, record in enumerate(records, start=1)
            )
    elif result.program is not None:
        layout: Literal["python", "table1"] = "table1" if task.config.strict else "python"
        others = [candidate.program for candidate in result.candidates[1 : task.config.top]]
        others += [one.program for one in more if one.program is not None]
        texts = tuple(format_program(program, layout=layout) for program in (result.program, *others))
    return Outcome(
        photo=task.photo,
        result=result,
        more=more,
        texts=texts,
        records=records,
        code=code,
        seconds=seconds,
    )


def _plain(value: Any) -> Any:
    """What json cannot write, as it can: arrays and tensors as lists, the rest as text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
