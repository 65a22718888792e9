"""Text -> program, or everything that is wrong with the text. Total: no input raises."""

from dataclasses import dataclass

from p3i.grammar import checker
from p3i.grammar.ast import Program
from p3i.grammar.diagnostics import Diagnostic, error, in_order
from p3i.grammar.header import HeaderReading, read_header
from p3i.grammar.heads import span_of
from p3i.grammar.layout import Words, decode, lay_out, source_text, too_deep, words
from p3i.grammar.normal import Blank
from p3i.grammar.reader import Stopped, lex, read_program
from p3i.grammar.recovery import explain_structure, read_heads
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
    found = words(text, lex(text))
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
    outcome = read_program(lay_out(found))
    if not isinstance(outcome, Stopped):
        return plant(outcome, reading, end=end), ()
    heads, problems, whole = read_heads(found)
    tree = plant(heads, reading, end=end, whole=whole)
    if not problems and not tree.problems:
        problems = (explain_structure(outcome, found),)
    return tree, problems
