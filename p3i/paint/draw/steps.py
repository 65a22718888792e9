"""The steps of a search, as its trace tells them: JSON lines, each with a program where there is one.

The first line of a photo is its `photo` record (width, height, focal, version), the last its `answer`. What
lies between was tried; a step without a program changes nothing in the picture.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from p3i.errors import FileError
from p3i.grammar.ast import Program
from p3i.grammar.parser import parse
from p3i.size import Size

VERSION = 1
"""The version of traces that this reader knows."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step: its name, the program that it weighed, its score if it has one, the focal of its camera."""

    name: str
    program: Program | None
    score: float | None
    focal_mm: float
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Search:
    """The search of one photo: the photo's name and canvas, and the steps in order, the answer last."""

    image: str
    size: Size
    steps: tuple[Step, ...]

    @property
    def ended(self) -> bool:
        """Whether the trace holds the answer; one that was cut short does not."""
        return bool(self.steps) and self.steps[-1].name == "answer"


def read_steps(lines: Iterable[str], *, name: str) -> tuple[Search, ...]:
    """The searches that a trace holds, in order. `name` is what messages call the trace.

    Raises FileError with the line's number for what is no trace, and for a trace without a photo.
    """
    searches: list[tuple[str, Size, float, list[Step]]] = []
    for number, record in _records(lines, name):
        place = f"{name}:{number}"
        if record.get("step") == "photo":
            if (version := record.get("version")) != VERSION:
                raise FileError(
                    f"{place}: this is a trace of version {version!r}; p3i reads version {VERSION}"
                )
            width, height, focal = (_number(record, key, place) for key in ("width", "height", "focal"))
            if not (1 <= width <= 10**6 and 1 <= height <= 10**6 and 1 <= focal <= 10**4):
                raise FileError(f"{place}: no photo has a width, height and focal like these")
            image = str(record.get("image") or "")
            searches.append((image, Size(int(width), int(height)), focal, []))
        elif not searches:
            raise FileError(
                f"{place}: a trace begins with the record of a photo; write one with synth --trace"
            )
        else:
            searches[-1][3].append(_step(record, focal_mm=searches[-1][2], place=place))
    if not searches:
        raise FileError(f"{name}: this trace is empty; write one with synth --trace")
    return tuple(Search(image, size, tuple(steps)) for image, size, _, steps in searches)


def _records(lines: Iterable[str], name: str) -> Iterator[tuple[int, Mapping[str, Any]]]:
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            record = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise FileError(f"{name}:{number}: this line is no JSON ({error})") from None
        if not isinstance(record, dict) or not isinstance(record.get("step"), str):
            raise FileError(f'{name}:{number}: a line of a trace is an object with a "step"')
        yield number, record


def _step(record: Mapping[str, Any], *, focal_mm: float, place: str) -> Step:
    text, program = record.get("program"), None
    if text is not None:
        found = parse(text) if isinstance(text, str) else ()
        if not isinstance(found, Program):
            why = f" ({found[0].message})" if found else ""
            raise FileError(f"{place}: its program cannot be read{why}")
        program = found
    score = None if record.get("score") is None else _number(record, "score", place)
    focal = focal_mm if record.get("focal") is None else _number(record, "focal", place)
    if not 1 <= focal <= 10**4:
        raise FileError(f"{place}: no lens has a focal length of {focal:g} mm")
    return Step(record["step"], program, score, focal, str(record.get("reason") or ""))


def _number(record: Mapping[str, Any], key: str, place: str) -> float:
    value = record.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FileError(f"{place}: {key!r} should be a number, and is {value!r}")
    return float(value)
