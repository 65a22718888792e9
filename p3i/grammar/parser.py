"""Text -> program, or everything that is wrong with the text. Total: no input raises."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from lark import Lark, Token, UnexpectedInput
from lark.lark import PostLex

from p3i.grammar import checker
from p3i.grammar.ast import Program
from p3i.grammar.diagnostics import Diagnostic, error, in_order
from p3i.grammar.header import HeaderReading, read_header
from p3i.grammar.heads import HeadReader, span_of
from p3i.grammar.layout import Words, decode, lay_out, source_text, too_deep, words
from p3i.grammar.normal import Blank
from p3i.grammar.recovery import HEAD_RULES, explain_structure, read_heads
from p3i.grammar.tree import Tree, plant


@dataclass(frozen=True, slots=True)
class Parsed:
    """A program with the holes of its text by path, and warnings about its header."""

    program: Program
    holes: dict[str, Blank]
    warnings: tuple[Diagnostic, ...]


def parse(source: str | bytes, *, strict: bool = False) -> Program | tuple[Diagnostic, ...]:
    """The program that `source` spells, or all errors in it, in the order of the text.

    With `strict` the text must be a string of Table 1 (table1.lark). Warnings come from `checker.warnings`;
    holes are errors here, and `sketch.parse_sketch` reads them.
    """
    parsed = parse_with_holes(source)
    if isinstance(parsed, tuple):
        return parsed
    if parsed.holes:
        return tuple(
            error(
                "P116",
                "this is a sketch: a program has no holes",
                hole.span,
                help="write a number in its place",
            )
            for hole in parsed.holes.values()
        )
    if strict:
        from p3i.grammar.strict import strict_problems  # its grammar is built on demand

        problems = strict_problems(source_text(source), parsed.program)
        if problems:
            return problems
    return parsed.program


def parse_with_holes(source: str | bytes) -> Parsed | tuple[Diagnostic, ...]:
    """As `parse`, for programs and sketches alike."""
    text = decode(source)
    if isinstance(text, Diagnostic):
        return (text,)
    found = words(text, superset().lex(text))
    refused = too_deep(found.tokens)
    if refused:
        return (refused,)
    first = span_of(found.tokens[0]).start if found.tokens else len(text)
    reading = read_header(found.comments, first_statement=first)
    tree, problems = _read(found, reading, end=len(text))
    header_errors = [problem for problem in reading.diagnostics if problem.severity == "error"]
    if tree.program is not None:
        problems = (*problems, *checker.errors(tree.program, source=text))
    if tree.program is None or problems or header_errors:
        return in_order((*header_errors, *tree.problems, *problems))
    header_warnings = tuple(problem for problem in reading.diagnostics if problem.severity == "warning")
    return Parsed(tree.program, tree.holes, header_warnings)


def _read(found: Words, reading: HeaderReading, *, end: int) -> tuple[Tree, tuple[Diagnostic, ...]]:
    """The tree, and the problems of syntax: first by the whole grammar, then statement by statement."""
    if not found.tokens:
        return plant((), reading, end=end), ()
    outcome = feed("program", lay_out(found))
    if isinstance(outcome, tuple):
        return plant(outcome, reading, end=end), ()
    heads, problems = read_heads(found, feed)
    tree = plant(heads, reading, end=end) if heads else Tree(None, {}, ())
    if not problems and not tree.problems:
        problems = (explain_structure(outcome, found),)
    return tree, problems


def feed(start: str, tokens: Iterable[Token]) -> Any:
    """What the rule `start` reads `tokens` as, or the UnexpectedInput that stopped it."""
    reader = superset().parse_interactive(start=start)
    last: Token | None = None
    try:
        for token in tokens:
            reader.feed_token(token)
            last = token
        return reader.feed_eof(last)
    except UnexpectedInput as problem:
        return problem


@cache
def superset() -> Lark:
    """The reader of p3p.lark, built once a process."""
    return Lark(
        files("p3i.grammar").joinpath("p3p.lark").read_text(encoding="utf-8"),
        parser="lalr",
        lexer="basic",
        start=["program", *HEAD_RULES],
        transformer=HeadReader(),
        postlex=_KeepEverything(),
        maybe_placeholders=False,
    )


class _KeepEverything(PostLex):
    """Keeps the words that no rule mentions in the lexer; layout.py does what a postlex would do."""

    always_accept = ("LINE_END", "COMMENT", "FOREIGN", "STRAY")

    def process(self, stream: Any) -> Any:
        return stream
