"""The import tables of the house (docs/README.md): who may import whom, where heavy packages may stand."""

import ast
from collections.abc import Iterator, Set
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "p3i"
FILES = sorted(PACKAGE.rglob("*.py"))

# The parts of p3i that each part may import besides itself; leaves may be imported by all.
LEAVES = {"p3i.errors", "p3i.size", "p3i.files", "p3i.records", "p3i.marks"}
GRAMMAR, INTERP, VISION = "p3i.grammar", "p3i.interp", "p3i.vision"
OPTIONS, PLACE, EXPORT = "p3i.options", "p3i.place", "p3i.export"
DRAW, STRAIGHT, FILL, EDIT = "p3i.paint.draw", "p3i.paint.straight", "p3i.paint.fill", "p3i.paint.edit"
LOOK, FORMS, FIT = "p3i.search.look", "p3i.search.forms", "p3i.search.fit"
PROPOSE, EXTENT = "p3i.search.propose", "p3i.search.extent"
JUDGE, OPTICS = "p3i.search.judge", "p3i.search.optics"
# What goes into a search and comes out of it: leaves of its rooms.
ANSWERS = {"p3i.search.config", "p3i.search.result", "p3i.search.answer"}
SEARCH = "p3i.search"  # the loops that join its rooms: what stands in p3i/search itself
LANGUAGE, CARRIED, NOTEBOOK = "p3i.language", "p3i.carried", "p3i.notebook"
EVALUATION, API, CLI = "p3i.evaluation", "p3i.api", "p3i.cli"

BELOW = {GRAMMAR, INTERP, VISION}
PAINT = {DRAW, STRAIGHT, FILL, EDIT}
ROOMS = {LOOK, FORMS, FIT, PROPOSE, EXTENT, JUDGE, OPTICS}
ALL = {*BELOW, OPTIONS, PLACE, EXPORT, *PAINT, SEARCH, *ROOMS, *ANSWERS, LANGUAGE, CARRIED}
ALLOWED: dict[str, set[str]] = {
    **{leaf: set() for leaf in LEAVES},
    GRAMMAR: set(),
    INTERP: {GRAMMAR},
    VISION: set(),
    OPTIONS: set(),
    PLACE: {OPTIONS, *BELOW},
    EXPORT: {PLACE, OPTIONS, *BELOW},
    DRAW: {PLACE, OPTIONS, *BELOW},
    STRAIGHT: {PLACE, OPTIONS, *BELOW},
    FILL: {PLACE, OPTIONS, *BELOW},
    EDIT: {PLACE, OPTIONS, *BELOW, FILL},
    **{leaf: {GRAMMAR, *ANSWERS} for leaf in ANSWERS},
    LOOK: {*ANSWERS, INTERP, VISION},
    FORMS: {*ANSWERS, GRAMMAR, INTERP, LOOK},
    FIT: {*ANSWERS, *BELOW, LOOK, FORMS},
    PROPOSE: {*ANSWERS, *BELOW, LOOK, FORMS, FIT},
    EXTENT: {*ANSWERS, *BELOW, LOOK, FORMS, FIT},
    JUDGE: {*ANSWERS, *BELOW, LOOK, FORMS, FIT},
    OPTICS: {*ANSWERS, *BELOW, LOOK, FORMS, FIT, JUDGE},
    SEARCH: {*ANSWERS, *BELOW, *ROOMS},
    # The torch-free functions of the API: what `p3i check` runs.
    LANGUAGE: {GRAMMAR, INTERP},
    # The one loader of programs; what paints and searches gets them read.
    CARRIED: {GRAMMAR, VISION},
    EVALUATION: ALL,
    API: {*ALL, EVALUATION},
    CLI: {*ALL, EVALUATION, API},
    NOTEBOOK: {*ALL, API},
    "p3i.__main__": {CLI},
    # The package itself re-exports, by name and when asked.
    "p3i": {*ALL, API, NOTEBOOK},
}
HEAVY = {"torch", "torchvision", "numpy", "cv2", "PIL", "scipy", "rich"}
GRAMMAR_MAY_IMPORT = {"lark"}
# Files that must be importable without any heavy package: what `--help`, `check`, `fmt` and `expand` load.
LIGHT = ["p3i", "p3i.api", "p3i.language", "p3i.carried", "p3i.cli", "p3i.grammar", *sorted(LEAVES)]
LIGHT += [OPTIONS, "p3i.search.config", "p3i.search.result"]
LIGHT += ["p3i.interp.unroll", "p3i.vision.picture_kinds"]
# Packages whose own file must be empty of imports, since importing any part of them runs it.
BARE = [
    CLI,
    GRAMMAR,
    INTERP,
    VISION,
    OPTIONS,
    PLACE,
    EXPORT,
    "p3i.paint",
    *sorted(PAINT),
    "p3i.paint.fill.npn",
]
BARE += [SEARCH, *sorted(ROOMS)]


def module_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = frozenset(map(module_of, FILES))


def part_of(module: str) -> str:
    """The part of the table that a module of p3i belongs to: the longest name there that begins its own."""
    parts = module.split(".")
    names = (".".join(parts[:count]) for count in range(len(parts), 0, -1))
    return next(name for name in names if name in ALLOWED)


def imports(path: Path, *, inside_functions: bool, for_types: bool = True) -> Iterator[tuple[str, int]]:
    """The modules that a file imports, with their lines; those under TYPE_CHECKING too if `for_types`."""

    def walk(node: ast.AST) -> Iterator[tuple[str, int]]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) and not inside_functions:
                continue
            if (
                isinstance(child, ast.If)
                and isinstance(child.test, ast.Name)
                and child.test.id == "TYPE_CHECKING"
                and not for_types
            ):
                continue
            if isinstance(child, ast.Import):
                yield from ((alias.name, child.lineno) for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                assert child.level == 0, f"{path}:{child.lineno}: write imports in full"
                assert child.module is not None
                # `from p3i.cli import options` imports the module p3i.cli.options.
                inner = [f"{child.module}.{alias.name}" for alias in child.names]
                yield from ((name if name in MODULES else child.module, child.lineno) for name in inner)
            else:
                yield from walk(child)

    return walk(ast.parse(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_a_file_needs_only_what_its_part_may(path: Path) -> None:
    """By an import anywhere in it, or by a name in a string."""
    part = part_of(module_of(path))
    wrong = {name for name in needs(path) if part_of(name) not in ALLOWED[part] | LEAVES | {part}}
    assert not wrong - {"p3i"}, f"{part} may not import these"


def test_every_room_and_part_holds_something() -> None:
    parts = {part_of(module_of(path)) for path in FILES}
    assert ALLOWED.keys() - parts == set()


@pytest.mark.parametrize("path", sorted((PACKAGE / "grammar").glob("*.py")), ids=module_of)
def test_grammar_imports_lark_and_the_standard_library_only(path: Path) -> None:
    import sys

    for name, line in imports(path, inside_functions=True):
        top = name.split(".")[0]
        known = top == "p3i" or top in GRAMMAR_MAY_IMPORT or top in sys.stdlib_module_names
        assert known, f"{path}:{line}: grammar may not import {name}"


def light_files() -> list[Path]:
    def is_light(module: str) -> bool:
        return any(module == name or (name != "p3i" and module.startswith(f"{name}.")) for name in LIGHT)

    return [path for path in FILES if is_light(module_of(path))]


@pytest.mark.parametrize("path", light_files(), ids=module_of)
def test_light_files_import_heavy_packages_inside_functions_only(path: Path) -> None:
    light = set(map(module_of, light_files())) | set(BARE)
    for name, line in imports(path, inside_functions=False, for_types=False):
        assert name.split(".")[0] not in HEAVY, f"{path}:{line}: import {name} inside a function"
        if name.startswith("p3i."):
            assert name in light, f"{path}:{line}: {name} loads torch or cv2; import it inside a function"


@pytest.mark.parametrize("name", BARE)
def test_the_package_files_import_nothing(name: str) -> None:
    path = PACKAGE.parent.joinpath(*name.split(".")) / "__init__.py"
    assert list(imports(path, inside_functions=False, for_types=False)) == []


@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_no_file_is_a_bag_or_longer_than_400_lines(path: Path) -> None:
    assert path.stem not in {"utils", "util", "helpers", "common", "misc", "tools"}
    lines = path.read_text(encoding="utf-8").count("\n")
    assert lines <= 400, f"{module_of(path)} has {lines} lines; split it"


def test_one_function_alone_calls_grid_sample_and_prints_stay_in_the_command_line() -> None:
    samplers = [module_of(path) for path in FILES for name in called(path) if name == "grid_sample"]
    assert samplers == ["p3i.vision.warp"]
    printers = {module_of(path) for path in FILES for name in called(path) if name == "print"}
    assert not {name for name in printers if not name.startswith("p3i.cli")}


def called(path: Path) -> Iterator[str]:
    """The bare names of the functions that a file calls."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            if isinstance(node.func, ast.Name):
                yield node.func.id
            elif isinstance(node.func, ast.Attribute):
                yield node.func.attr


@cache
def needs(path: Path) -> frozenset[str]:
    """Every module of p3i that a file names: in imports at any depth, also for types, and in strings.

    A string that is a module's name is an import of it: by import_module, or by a table that feeds that.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    named = {word for word in words if isinstance(word, str) and word.startswith("p3i.")}
    return ({name for name, _ in imports(path, inside_functions=True)} | named) & MODULES


def circle_in(graph: dict[str, Set[str]]) -> list[str]:
    """The nodes of a graph that lie on a circle, or lead to one; empty where there is none."""
    left = {node: set(targets) for node, targets in graph.items()}
    while ends := [node for node, targets in left.items() if not targets & left.keys()]:
        for node in ends:
            del left[node]
    return sorted(left)


def test_no_file_needs_itself_through_others() -> None:
    graph = {module_of(path): needs(path) for path in FILES}
    assert circle_in(graph) == []


def test_the_search_for_circles_sees_strings_and_inner_imports(tmp_path: Path) -> None:
    told = tmp_path / "told.py"
    told.write_text(
        "def late():\n    from p3i.grammar import ast\n    importlib.import_module('p3i.notebook')\n"
        "if TYPE_CHECKING:\n    from p3i.size import Size\n"
    )
    assert needs(told) == {"p3i.grammar.ast", "p3i.notebook", "p3i.size"}
    assert circle_in({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"e"}, "e": set()}) == ["a", "b", "c"]


def test_nobody_imports_the_notebook_but_the_package_itself() -> None:
    assert [module_of(path) for path in FILES if "p3i.notebook" in needs(path)] == ["p3i"]


def test_the_printer_needs_no_reader() -> None:
    graph = {module_of(path): needs(path) for path in FILES}
    reached, todo = set(), ["p3i.grammar.printer"]
    while todo:
        node = todo.pop()
        reached.add(node)
        todo += graph[node] - reached
    assert not reached & {"p3i.grammar.reader", "p3i.grammar.parser", "p3i.grammar.strict"}
