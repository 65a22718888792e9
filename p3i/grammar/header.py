"""The header: an optional block of TOML in comments, in the shape of PEP 723.

    # /// p3p
    # version = 1
    # canvas = [640, 480]
    # ///

It stands above the first statement. What it says becomes `Header`; unknown keys are warned of and kept.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from p3i.grammar.ast import FitValue, Header, Span
from p3i.grammar.diagnostics import Diagnostic, error, warning

OPENING = "# /// p3p"
CLOSING = "# ///"
_EXAMPLE = "write the block as `# /// p3p`, one `# key = value` a line, `# ///`"


@dataclass(frozen=True, slots=True)
class Comment:
    """A comment with its place; `alone` where nothing else stands on its line."""

    text: str
    span: Span
    line: int
    alone: bool


@dataclass(frozen=True, slots=True)
class HeaderReading:
    """What the comments of a program hold: the header if there is one, the other comments, and findings."""

    header: Header | None
    comments: tuple[Comment, ...]
    diagnostics: tuple[Diagnostic, ...] = ()


def read_header(comments: Sequence[Comment], *, first_statement: int) -> HeaderReading:
    """Split the header off the comments. `first_statement` is the offset of the program's first token."""
    openings = [place for place, comment in enumerate(comments) if comment.text == OPENING]
    if not openings:
        return HeaderReading(None, tuple(comments))
    start = openings[0]
    problems: list[Diagnostic] = []
    for place in openings[1:]:
        problems.append(
            error("P118", "a program has one header block", comments[place].span, help="remove one")
        )
    opening = comments[start]
    if not opening.alone or opening.span.start > first_statement:
        message = "the header block stands above the first statement"
        problems.append(error("P118", message, opening.span, help="move it to the top, on lines of its own"))
    end = start + 1
    while end < len(comments) and comments[end].alone and comments[end].line == comments[end - 1].line + 1:
        if comments[end].text == CLOSING:
            break
        end += 1
    else:
        problems.append(
            error("P118", "the header block has no end", opening.span, help="close it with `# ///`")
        )
        return HeaderReading(None, tuple(comments), tuple(problems))
    block = comments[start : end + 1]
    values, found = _read_toml(block)
    header, more = _header(values, block)
    above = tuple(comment.text for comment in comments[:start])
    if header is not None:
        header = Header(
            header.version, header.canvas, header.focal_mm, header.image, header.fit, header.lens_k1,
            lines=tuple(comment.text for comment in block), comments=above,
        )  # fmt: skip
    return HeaderReading(header, tuple(comments[end + 1 :]), (*problems, *found, *more))


def header_lines(header: Header) -> tuple[str, ...]:
    """The header as comment lines, with the comments above it: as written where that still holds."""
    if header.lines and _read_lines(header.lines) == header:
        return (*header.comments, *header.lines)
    lines = [f"version = {header.version}"]
    if header.canvas is not None:
        lines.append(f"canvas = [{header.canvas[0]}, {header.canvas[1]}]")
    if header.focal_mm is not None:
        lines.append(f"focal = {_toml(header.focal_mm)}")
    if header.lens_k1 is not None:
        lines.append(f"lens_k1 = {_toml(header.lens_k1)}")
    if header.image is not None:
        lines.append(f"image = {_toml(header.image)}")
    if header.fit:
        lines.append("[fit]")
        lines += [f"{_key(key)} = {_toml(value)}" for key, value in header.fit]
    return (*header.comments, OPENING, *(f"# {line}" for line in lines), CLOSING)


def _read_lines(lines: Sequence[str]) -> Header | None:
    """The header that the block `lines` stands for; None where it is not a valid one."""
    block = [Comment(text, Span(0, 0), number, alone=True) for number, text in enumerate(lines)]
    if len(block) < 2 or block[0].text != OPENING or block[-1].text != CLOSING:
        return None
    values, problems = _read_toml(block)
    header, more = _header(values, block)
    return None if any(found.severity == "error" for found in (*problems, *more)) else header


def _read_toml(block: Sequence[Comment]) -> tuple[dict[str, Any], tuple[Diagnostic, ...]]:
    for comment in block:
        if comment.text != "#" and not comment.text.startswith("# "):
            message = "a line of the header block starts with `# `"
            return {}, (error("P118", message, comment.span, help=_EXAMPLE),)
    import tomllib  # few programs have a header, and it takes 5 ms to load

    try:
        return tomllib.loads("\n".join(comment.text[2:] for comment in block[1:-1]) + "\n"), ()
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as problem:
        span = _guilty_line(str(problem), block)
        return {}, (
            error("P118", f"the header block is not TOML: {_sentence(problem)}", span, help=_EXAMPLE),
        )


def _sentence(problem: Exception) -> str:
    if isinstance(problem, RecursionError):
        return "it is nested too deeply"
    return str(problem).split(" (at ")[0]


def _guilty_line(problem: str, block: Sequence[Comment]) -> Span:
    """tomllib says the line in its sentence, and only there."""
    _, _, place = problem.partition("(at line ")
    number = place.partition(",")[0]
    if number.isdecimal() and 0 < int(number) < len(block) - 1:
        return block[int(number)].span
    return block[0].span


def _header(values: dict[str, Any], block: Sequence[Comment]) -> tuple[Header | None, tuple[Diagnostic, ...]]:
    """The header from its TOML values, None where a value is not what its key needs."""
    problems: list[Diagnostic] = []

    def refuse(key: str, needs: str) -> None:
        problems.append(error("P118", f"`{key}` of the header must be {needs}", _line_of(key, block)))

    version: Any = values.get("version", 1)
    if version is True or version != 1:
        refuse("version", "1, the only version that this p3i reads")
    canvas: Any = values.get("canvas")
    if canvas is not None and not _is_canvas(canvas):
        refuse("canvas", "two whole numbers from 1 to 1,000,000, as in `canvas = [640, 480]`")
    focal: Any = values.get("focal")
    if focal is not None and not (_is_number(focal) and focal > 0):
        refuse("focal", "a positive number of millimetres, as in `focal = 35.0`")
    lens_k1: Any = values.get("lens_k1")
    if lens_k1 is not None and not (_is_number(lens_k1) and abs(lens_k1) < 0.4):
        refuse("lens_k1", "a number between -0.4 and 0.4, as in `lens_k1 = -0.08`")
    image: Any = values.get("image")
    if image is not None and not (isinstance(image, str) and image and "\0" not in image):
        refuse("image", 'a path in quotes, as in `image = "tiles.jpg"`')
    fit: Any = values.get("fit", {})
    if not (isinstance(fit, dict) and all(_is_scalar(value) for value in cast(dict[str, Any], fit).values())):
        refuse("fit", "a table of numbers, texts, true and false")
    if problems:
        return None, tuple(problems)
    known = {"version", "canvas", "focal", "lens_k1", "image", "fit"}
    strangers = tuple(
        warning(
            "P119",
            f"the header has no key `{key}`",
            _line_of(key, block),
            help=f"known are {', '.join(sorted(known))}",
        )
        for key in values
        if key not in known
    )
    facts = cast(dict[str, FitValue], fit)
    size = tuple(canvas) if canvas else None
    return Header(1, size, focal, image, tuple(facts.items()), lens_k1), strangers


def _is_number(value: object) -> bool:
    """Whether the value is a number that a double holds: TOML's whole numbers have no end."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _is_canvas(value: Any) -> bool:
    return (
        isinstance(value, list)
        and len(cast(list[Any], value)) == 2
        and all(
            isinstance(side, int) and not isinstance(side, bool) and 1 <= side <= 1_000_000
            for side in cast(list[Any], value)
        )
    )


def _is_scalar(value: object) -> bool:
    return isinstance(value, str | bool) or _is_number(value)


def _line_of(key: str, block: Sequence[Comment]) -> Span:
    """The line that sets `key`, or the block's first line where it is spelt in an unusual way."""
    for comment in block:
        written = comment.text.removeprefix("# ").lstrip()
        if written.startswith((f"{key} ", f"{key}=", f"[{key}]", f'"{key}"')):
            return comment.span
    return block[0].span


def _toml(value: FitValue) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # TOML's basic strings take JSON's escapes; DEL is the one character that JSON leaves bare
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def _key(key: str) -> str:
    bare = key and all(
        character.isascii() and (character.isalnum() or character in "-_") for character in key
    )
    return key if bare else _toml(key)
