"""lark, behind three typed functions: the words of a text, and what a rule of a grammar makes of words.

The rest of the package sees lark's tokens and no more of it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer, UnexpectedCharacters, UnexpectedInput
from lark.lark import PostLex

from p3i.grammar.heads import Head, HeadReader

HEAD_RULES = {"CAMERA": "camera", "FOR": "for_head", "IF": "if_head", "DRAW": "draw"}
"""The word that a statement starts with -> the rule of p3p.lark for its head."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """Where a rule could not go on: the word there, and the kinds of words that could have stood there."""

    token: Token
    expected: frozenset[str]


def lex(text: str) -> Iterator[Token]:
    """The words of a text by p3p.lark, comments and line ends included. Every text has words."""
    return _superset().lex(text)


def read_program(tokens: Iterable[Token]) -> tuple[Head, ...] | Stopped:
    """The heads of a whole program."""
    return _feed("program", tokens)


def read_head(rule: str, tokens: Iterable[Token]) -> Head | Stopped:
    """One head by one of HEAD_RULES."""
    return _feed(rule, tokens)


def read_table1(text: str, reader: Transformer[Token, Any]) -> Any | Stopped:
    """What `reader` makes of a text by table1.lark."""
    try:
        return reader.transform(_table1().parse(text))
    except UnexpectedInput as problem:
        return _stopped(problem)


def _feed(rule: str, tokens: Iterable[Token]) -> Any:
    reader = _superset().parse_interactive(start=rule)
    last: Token | None = None
    try:
        for token in tokens:
            reader.feed_token(token)
            last = token
        return reader.feed_eof(last)
    except UnexpectedInput as problem:
        return _stopped(problem)


def _stopped(problem: Any) -> Stopped:
    """The facts in an UnexpectedInput, whose fields lark types in part only."""
    if problem.__class__ is UnexpectedCharacters:
        return Stopped(Token("STRAY", problem.char, problem.pos_in_stream), frozenset())
    return Stopped(problem.token, frozenset(problem.accepts or problem.expected))


@cache
def _superset() -> Any:
    """The reader of p3p.lark, made once a process: in about 20 ms."""
    return build_superset()


def build_superset() -> Lark:
    """A reader of p3p.lark.

    Its callbacks run while it parses, so that there is neither a tree nor recursion.
    """
    return Lark(
        grammar_text("p3p.lark"),
        parser="lalr",
        lexer="basic",
        start=["program", *HEAD_RULES.values()],
        transformer=HeadReader(),
        postlex=_KeepEverything(),
        maybe_placeholders=False,
    )


@cache
def _table1() -> Any:
    """The reader of table1.lark, a Lark, made once a process and only in strict mode."""
    return Lark(grammar_text("table1.lark"), parser="lalr", start="program")


def grammar_text(name: str) -> str:
    """The text of one of the two grammars, p3p.lark or table1.lark."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


class _KeepEverything(PostLex):
    """Keeps the words that no rule mentions in the lexer; layout.py does what a postlex would do."""

    always_accept = ("LINE_END", "COMMENT", "FOREIGN", "STRAY")

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        return stream
