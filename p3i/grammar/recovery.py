"""After a syntax error: read the text statement by statement, so that one run reports every problem.

A program is a chain of heads (camera, loops, guards, draw), each of which starts with its own word. So the
words are cut before each of those words, and at each line that starts with a stranger, and every piece is
read by its own rule. What only shows in the whole (a missing indent, a brace that never closes) is
explained from the place where the whole grammar stopped.
"""

from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass

from lark import Token

from p3i.grammar.ast import Span
from p3i.grammar.diagnostics import Diagnostic, error
from p3i.grammar.heads import Head, span_of
from p3i.grammar.layout import CLOSING, OPENING, Words
from p3i.grammar.reader import HEAD_RULES, Stopped, read_head

_NAMES = {"CAMERA": "SetCameraPose", "FOR": "for", "IF": "if", "DRAW": "Draw"}


@dataclass(frozen=True, slots=True)
class Piece:
    """The words of one statement's head, without the `:`, `{`, `}` and `;` after it."""

    tokens: tuple[Token, ...]
    opened: bool
    """Whether a `:` or `{` follows the head."""


def read_heads(found: Words) -> tuple[tuple[Head, ...], tuple[Diagnostic, ...], bool]:
    """The heads that can be read, the problems of the others, and whether all could be read."""
    heads: list[Head] = []
    problems: list[Diagnostic] = []
    whole = True
    for piece in pieces(found):
        first = piece.tokens[0]
        rule = HEAD_RULES.get(first.type)
        if rule is None:
            problems.extend(_stranger(piece))
            whole = False
            continue
        outcome = read_head(rule, piece.tokens)
        if isinstance(outcome, Stopped):
            problems.extend(_explain(outcome, piece))
            whole = False
            continue
        heads.append(outcome)
        if first.type in {"FOR", "IF"} and not piece.opened:
            end = span_of(piece.tokens[-1]).end
            word = _NAMES[first.type]
            message = f"`{word}` needs a `:` at its end"
            problems.append(
                error(
                    "P101",
                    message,
                    Span(end, end + 1),
                    label="expected `:`",
                    help="write `:` and indent the next line",
                )
            )
    return tuple(heads), tuple(problems), whole


def pieces(found: Words) -> Iterator[Piece]:
    """Cut the words into statement heads."""
    cuts: list[int] = []
    depth = 0
    for position, token in enumerate(found.tokens):
        if token.type in HEAD_RULES and not _is_argument(found.tokens, position):
            cuts.append(position)
            depth = 0
        elif position == 0 or (
            position in found.indents
            and depth == 0
            and token.type not in {"LBRACE", "RBRACE", "SEMICOLON", "COLON"}
        ):
            cuts.append(position)
        depth = max(0, depth + (token.type == "LPAR") - (token.type == "RPAR"))
    for start, end in zip(cuts, [*cuts[1:], len(found.tokens)], strict=True):
        tokens = list(found.tokens[start:end])
        while len(tokens) > 1 and tokens[-1].type in {"RBRACE", "SEMICOLON"}:
            tokens.pop()
        opened = len(tokens) > 1 and tokens[-1].type in {"COLON", "LBRACE"}
        while len(tokens) > 1 and tokens[-1].type in {"COLON", "LBRACE"}:
            tokens.pop()
        yield Piece(tuple(tokens), opened)


def _is_argument(tokens: Sequence[Token], position: int) -> bool:
    """Whether a word that could start a statement stands where an operand does, as in `x = for`."""
    return position > 0 and tokens[position - 1].type in {"EQUAL", "PLUS", "MINUS", "TIMES", "OVER"}


_STRANGERS = {
    "rotate": "write `for j in range(0, n):` with `Cos` and `Sin` in its Draw",
    "while": "write `for i in range(0, n):`",
    "else": "there is no `else`: a program draws where its guards hold",
    "elif": "there is no `elif`: a program draws where its guards hold",
    "circle": "write `Draw(x=..., y=...)`",
    "setcamera": "write `SetCameraPose(rx=0, ry=0)`",
}


def _stranger(piece: Piece) -> list[Diagnostic]:
    """A line that starts with no word of the language."""
    first = piece.tokens[0]
    if first.type in _BY_TYPE:
        return _strays(first, piece)
    help = _STRANGERS.get(
        first.lower().removesuffix("-loop"), "statements are SetCameraPose, `for`, `if` and Draw"
    )
    return [error("P101", f"no statement starts with `{_quote(first)}`", span_of(first), help=help)]


def _strays(first: Token, piece: Piece) -> list[Diagnostic]:
    """The word that stopped the reader and those after it that stand nowhere in the language either.

    After a quote without its partner the rest of the line proves nothing.
    """
    if str(first) in {'"', "'"}:
        return [_of_token(first)]
    after = [
        token
        for token in piece.tokens
        if token.type in _BY_TYPE and span_of(token).start >= span_of(first).start
    ]
    return [_of_token(token) for token in after[:_MOST_STRAYS]]


_MOST_STRAYS = 8
"""In one statement: a text that is no program at all need not be listed letter by letter."""


_FOREIGN_HELP = {
    "==": "write two guards: `a >= b` and `a <= b`",
    "!=": "a guard is `>=` or `<=`: what is drawn is convex",
    "<>": "a guard is `>=` or `<=`: what is drawn is convex",
    ">": "write `>=`; over whole numbers `i > 3` is `i >= 4`",
    "<": "write `<=`; over whole numbers `i < 3` is `i <= 2`",
    "**": "coordinates have no powers: write `a*i + b*j + c`",
    "//": "write `/` and a number",
    "^": "coordinates have no powers: write `a*i + b*j + c`",
    "%": "there is no remainder: write `a*i + b*j + c`",
    "&&": "write `and`",
    "||": "there is no `or`: what is drawn is convex",
    "&": "write `and`",
    "|": "there is no `or`: what is drawn is convex",
    "!": "there is no `not`: turn the guard round, `>=` into `<=`",
}
_STRAY_HELP = {
    "\N{MINUS SIGN}": "write `-`",
    "\N{EN DASH}": "write `-`",
    "\N{EM DASH}": "write `-`",
    "\N{MULTIPLICATION SIGN}": "write `*`",
    "\N{MIDDLE DOT}": "write `*`",
    "\N{DEGREE SIGN}": "leave it out: angles are in degrees",
    "\N{LEFT DOUBLE QUOTATION MARK}": 'write `"`',
    "\N{RIGHT DOUBLE QUOTATION MARK}": 'write `"`',
    "\N{NO-BREAK SPACE}": "write a plain space",
    '"': "close the text with the same quote, on the same line",
    "'": "close the text with the same quote, on the same line",
    "?": "a hole is `??` or `?name`",
    "[": "write `(`",
    "]": "write `)`",
    "\\": "lines go on inside brackets without it",
}
_WORD_HELP = {
    "or": "there is no `or`: what is drawn is convex",
    "not": "there is no `not`: turn the guard round, `>=` into `<=`",
    "else": "there is no `else`: a program draws where its guards hold",
}
_BY_TYPE = {"FOREIGN", "STRAY"}


def _of_token(token: Token) -> Diagnostic:
    """A word that stands nowhere in the language."""
    if token.type == "FOREIGN" or str(token) in _FOREIGN_HELP:
        message = f"the language has no operator `{_quote(token)}`"
        return error("P114", message, span_of(token), help=_FOREIGN_HELP.get(str(token)))
    named = f"`{_quote(token)}`" if token.isprintable() else f"the character U+{ord(token[0]):04X}"
    return error(
        "P102", f"{named} has no place in a program", span_of(token), help=_STRAY_HELP.get(str(token))
    )


def _explain(problem: Stopped, piece: Piece) -> list[Diagnostic]:
    """Why a head could not be read, from the word that stopped its rule."""
    if problem.token.type in _BY_TYPE:
        return _strays(problem.token, piece)
    return [_explain_word(problem, piece)]


def _explain_word(problem: Stopped, piece: Piece) -> Diagnostic:
    token, expected = problem.token, problem.expected
    tokens = piece.tokens
    statement = _NAMES[tokens[0].type]
    if token.type == "$END":
        return _unfinished(tokens, statement, expected)
    span = span_of(token)
    position = next(place for place, other in enumerate(tokens) if other is token)
    if str(token) in _WORD_HELP:
        return error("P114", f"the language has no `{token}`", span, help=_WORD_HELP[str(token)])
    if tokens[0].type == "IF" and token.type == "EQUAL":
        return error("P114", "a guard does not compare with `=`", span, help="write `>=` or `<=`")
    if tokens[0].type == "IF" and token.type in {"GE", "LE"}:
        help = "write two guards joined by `and`, as in `i >= 0 and i <= 3`"
        return error("P114", "a guard compares once", span, help=help)
    if "TIMES" in expected and token.type in {"NAME", "NUMBER", "LPAR", "COS", "SIN", "HOLE"}:
        return _missing_between(tokens[position - 1], token, after=tokens[position + 1 : position + 2])
    if _unclosed(tokens[:position], OPENING, CLOSING) is None:
        expected -= {"RPAR"}
    message = f"`{_quote(token)}` cannot stand here"
    return error("P101", message, span, label=_wanted(expected), help=_EXAMPLES[statement])


def _missing_between(before: Token, token: Token, *, after: Sequence[Token]) -> Diagnostic:
    """Two values side by side: an operator is missing, or a comma, or they are one misspelt thing."""
    together = Span(span_of(before).start, span_of(token).end)
    touching = span_of(before).end == span_of(token).start
    if before.type == "NAME" and before not in {"i", "j"} and token.type == "LPAR":
        message = f"`{_quote(before)}` is not a function of the language"
        return error("P107", message, span_of(before), help="the functions are `Cos(...)` and `Sin(...)`")
    misspelt = token.type == "NUMBER" or (token.type == "NAME" and token not in {"i", "j"})
    if touching and before.type == "NUMBER" and misspelt:
        message = f"`{_quote(before)}{_quote(token)}` is not a number"
        return error("P109", message, together, help="numbers are written like `12`, `1.5` or `1e-3`")
    if after and after[0].type == "EQUAL":
        message = f"a `,` is missing before `{_quote(token)}`"
        return error("P101", message, together, help=f"write `{_quote(before)}, {_quote(token)}=`")
    message = f"an operator is missing between `{_quote(before)}` and `{_quote(token)}`"
    return error("P101", message, together, help=f"write `{_quote(before)}*{_quote(token)}`")


_EXAMPLES = {
    "SetCameraPose": "write `SetCameraPose(rx=-30, ry=10)`",
    "for": "write `for i in range(0, 4):`",
    "if": "write `if i + j >= 3:`",
    "Draw": "write `Draw(x=10*i + 2*j, y=8*j)`",
}


def _unfinished(tokens: Sequence[Token], statement: str, expected: frozenset[str]) -> Diagnostic:
    """A head that ends too early: an open bracket is shown where it opens."""
    opened = _unclosed(tokens, OPENING, CLOSING)
    if opened and "RPAR" in expected:
        message = f"a `(` of `{statement}` is not closed"
        return error(
            "P101",
            message,
            span_of(opened),
            label="opened here",
            help=f"write `)` at its end; {_EXAMPLES[statement]}",
        )
    end = span_of(tokens[-1]).end
    message = f"`{statement}` ends too early"
    return error("P101", message, Span(end, end + 1), label=_wanted(expected), help=_EXAMPLES[statement])


_SHOWN = {
    "RPAR": "`)`",
    "LPAR": "`(`",
    "COMMA": "`,`",
    "COLON": "`:`",
    "LBRACE": "`{`",
    "RBRACE": "`}`",
    "SEMICOLON": "`;`",
    "EQUAL": "`=`",
    "IN": "`in`",
    "RANGE": "`range`",
    "GE": "`>=`",
    "LE": "`<=`",
    "NUMBER": "a number",
    "NAME": "a name",
    "_NL": "a new line",
    "_INDENT": "an indented line",
    "FOR": "`for`",
    "IF": "`if`",
    "DRAW": "`Draw`",
    "$END": "the end",
}


def _wanted(expected: frozenset[str]) -> str | None:
    """What could stand at a place, in few words."""
    names = [shown for name, shown in _SHOWN.items() if name in expected]
    if "NUMBER" in expected:
        names = ["a number"]
    if not names:
        return None
    if len(names) > 1 and names[-1] == _SHOWN["$END"]:
        names.pop()
    return f"expected {' or '.join(names[:3])}"


def explain_structure(problem: Stopped, found: Words) -> Diagnostic:
    """Why heads that are all well formed do not nest: indentation, braces, separators."""
    token, expected = problem.token, problem.expected
    unclosed = _unclosed(found.tokens, {"LBRACE"}, {"RBRACE"})
    if token.type == "$END" or (unclosed is not None and token.type in {"_NL", "_DEDENT"}):
        if unclosed is not None:
            return error(
                "P101",
                "a `{` is not closed",
                span_of(unclosed),
                label="opened here",
                help="write `}` at the end of its block",
            )
        end = span_of(found.tokens[-1]).end
        return error("P101", "the program ends too early", Span(end, end + 1), label=_wanted(expected))
    span = span_of(token)
    visible = Span(span.start, max(span.end, span.start + 1))
    if token.type in {"_INDENT", "_DEDENT"}:
        help = "indent the body of `for` and `if` by four spaces, and nothing else"
        return error("P103", "this line is indented in a way that fits no block", visible, help=help)
    if "_INDENT" in expected:
        help = "indent the body of `for` and `if` by four spaces"
        return error(
            "P103",
            "the body of a block is not indented",
            visible,
            label="expected an indented line",
            help=help,
        )
    if token.type == "RBRACE":
        return error("P101", "a `}` closes nothing", visible, help="remove it")
    if token.type == "_NL":
        return error("P101", "the line ends too early", visible, label=_wanted(expected))
    return error("P101", f"`{_quote(token)}` cannot stand here", visible, label=_wanted(expected))


def _unclosed(tokens: Sequence[Token], opening: Set[str], closing: Set[str]) -> Token | None:
    """The last bracket that opens and is not closed."""
    opened: list[Token] = []
    for token in tokens:
        if token.type in opening:
            opened.append(token)
        elif token.type in closing and opened:
            opened.pop()
    return opened[-1] if opened else None


def _quote(token: Token) -> str:
    """A word for a message, shortened where it is long."""
    text = str(token)
    return text if len(text) <= 24 else text[:20] + "..."
