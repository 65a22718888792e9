"""The parse tables of p3p.lark, worked out beforehand: reading them takes a tenth of the time of making them.

`python -m p3i.grammar.tables` writes p3p.tables.json anew after a change of the grammar. A file that does not
belong to the grammar beside it, or to the installed lark, is passed over, so it can never be wrong, only
slow; a test holds it fresh.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import lark
from lark.grammar import Rule
from lark.lexer import TerminalDef

FILE = Path(__file__).with_name("p3p.tables.json")


def load(grammar: str, **options: Any) -> lark.Lark | None:
    """The parser from the file, or None where the file does not belong to `grammar` and this lark."""
    try:
        stored: Any = json.loads(FILE.read_text(encoding="utf-8"), object_hook=_with_numbers)
    except (OSError, ValueError):
        return None
    if stored.get("key") != key(grammar):
        return None
    parser_class: Any = lark.Lark
    # what the standalone parsers that lark generates call
    return parser_class._load_from_dict(stored["data"], stored["memo"], **options)


def save(grammar: str, parser: Any) -> None:
    """Write the tables of `parser`, which was built from `grammar`."""
    data, memo = parser.memo_serialize([TerminalDef, Rule])
    # what the options hold besides plain values is given again on loading
    data["options"] = {name: value for name, value in data["options"].items() if _is_plain(value)}
    stored = {"key": key(grammar), "data": data, "memo": memo}
    FILE.write_text(json.dumps(stored, separators=(",", ":"), sort_keys=True) + "\n", encoding="utf-8")


def key(grammar: str) -> str:
    """What the tables depend on: the grammar's text and the version of lark."""
    return f"lark {lark.__version__}, grammar {hashlib.sha256(grammar.encode()).hexdigest()}"


def _is_plain(value: object) -> bool:
    return isinstance(value, str | int | float | list | None)


def _with_numbers(table: dict[str, Any]) -> dict[Any, Any]:
    """JSON turns the numbers of states into texts; turn them back."""
    return {int(name): value for name, value in table.items()} if all(map(str.isdecimal, table)) else table


if __name__ == "__main__":
    from p3i.grammar import reader

    grammar = reader.grammar_text("p3p.lark")
    save(grammar, reader.build_superset(grammar))
