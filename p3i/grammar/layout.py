"""From bytes to the words that p3p.lark's rules read: decoding, limits, comments, and line ends as tokens.

Outside brackets the end of a line is a word (`_NL`) and so is a change of indentation (`_INDENT`,
`_DEDENT`); inside `( )` and `{ }` neither counts. Every text has words: nothing here fails, except on text
that is not UTF-8 or exceeds a limit.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from lark import Token

from p3i.grammar.ast import Span
from p3i.grammar.diagnostics import Diagnostic, error
from p3i.grammar.header import Comment
from p3i.grammar.heads import span_of
from p3i.grammar.limits import NESTING, SOURCE

TAB = 4
OPENING = {"LPAR", "LBRACE"}
CLOSING = {"RPAR", "RBRACE"}


@dataclass(frozen=True, slots=True)
class Words:
    """A text's words without comments and line ends, its comments, and which words begin a line."""

    tokens: tuple[Token, ...]
    comments: tuple[Comment, ...]
    indents: dict[int, int]
    """Position in `tokens` of each first word of a line -> columns that it is indented by."""


def decode(source: str | bytes) -> str | Diagnostic:
    """The text, or why there is none."""
    if len(source) > (most_bytes() if isinstance(source, bytes) else SOURCE.value()):
        return _too_long()
    if isinstance(source, bytes):
        try:
            source = source.decode("utf-8")
        except UnicodeDecodeError as problem:
            before = len(source[: problem.start].decode("utf-8"))
            message = f"byte {source[problem.start]:#04x} at offset {problem.start} is not UTF-8 text"
            return error("P100", message, Span(before, before + 1), help="save the file as UTF-8")
    return source if len(source) <= SOURCE.value() else _too_long()


def most_bytes() -> int:
    """No text within the limit has more bytes than this; a reader of files need not go further."""
    return 4 * SOURCE.value()


def _too_long() -> Diagnostic:
    message = f"the text is longer than the limit of {SOURCE.value():,} characters"
    return error("P120", message, None, help=SOURCE.advice())


def source_text(source: str | bytes) -> str:
    """The text for quoting in a report, whatever its bytes."""
    return source.decode("utf-8", errors="replace") if isinstance(source, bytes) else source


def words(text: str, tokens: Iterable[Token]) -> Words:
    """Sort the lexer's tokens into words and comments."""
    found: list[Token] = []
    comments: list[Comment] = []
    indents: dict[int, int] = {}
    line, line_start, line_is_bare = 1, 0, True
    for token in tokens:
        place = span_of(token)
        if token.type == "LINE_END":
            line, line_start, line_is_bare = line + 1, place.end, True
            continue
        if token.type == "COMMENT":
            comments.append(
                Comment(
                    token.rstrip(), Span(place.start, place.start + len(token.rstrip())), line, line_is_bare
                )
            )
            continue
        if line_is_bare:
            before = text[line_start : place.start]
            indents[len(found)] = before.count(" ") + before.count("\t") * TAB
            line_is_bare = False
        found.append(token)
    return Words(tuple(found), tuple(comments), indents)


def too_deep(tokens: Sequence[Token]) -> Diagnostic | None:
    """The refusal of a text whose brackets, or whose loops and guards, nest deeper than the limit."""
    limit = NESTING.value()
    brackets = statements = 0
    for token in tokens:
        brackets += (token.type in OPENING) - (token.type in CLOSING)
        statements += token.type in {"FOR", "IF", "AND"}
        if max(brackets, statements) > limit:
            kind = "brackets" if brackets > limit else "loops and guards"
            help = f"write it flatter, or {NESTING.advice()}"
            return error("P121", f"{kind} nest deeper than {limit:,} levels", span_of(token), help=help)
    return None


def lay_out(found: Words) -> Iterator[Token]:
    """The words with `_NL`, `_INDENT` and `_DEDENT` between them.

    A line that returns to no earlier indentation gives an `_INDENT` of its own, which no rule accepts there.
    """
    levels: list[int] = []
    depth = 0
    before: Token | None = None
    for position, token in enumerate(found.tokens):
        indent = found.indents.get(position)
        if indent is not None and depth == 0:
            if before is None:
                levels.append(indent)  # a program may be indented as a whole
            elif _goes_on(before, token):
                if before.type == "SEMICOLON" and len(levels) == 1:
                    levels = [indent]
            else:
                yield _mark("_NL", token)
                while indent < levels[-1] and len(levels) > 1:
                    levels.pop()
                    yield _mark("_DEDENT", token)
                if indent != levels[-1]:
                    levels.append(indent)
                    yield _mark("_INDENT", token)
        depth = max(0, depth + (token.type in OPENING) - (token.type in CLOSING))
        before = token
        yield token
    if before is not None:
        end = before.update(type="_NL", value="")
        end.start_pos = span_of(before).end
        yield end
        for _ in levels[1:]:
            yield _mark("_DEDENT", end)


def _goes_on(before: Token, after: Token) -> bool:
    """Whether a line end between two words means nothing, as everywhere in Table 1.

    It does where the first cannot end a statement, or the second cannot begin one.
    """
    return before.type in {"CAMERA", "FOR", "IF", "DRAW", "SEMICOLON"} or after.type in {
        "LPAR",
        "LBRACE",
        "RBRACE",
        "SEMICOLON",
    }


def _mark(type: str, at: Token) -> Token:
    """A token of no text in front of `at`."""
    return Token.new_borrow_pos(type, "", at)
