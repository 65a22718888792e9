"""Functions on arrays tell their shapes, in the one alphabet of CONTRIBUTING.md."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import p3i.vision.warp

FOLDER = Path(p3i.vision.warp.__file__).parent
RULES = (FOLDER.parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARRAYS = ("ndarray", "NDArray", "Tensor", "Floats", "Mask", "Array")
# State dicts of networks: their shapes are an argument.
OF_ANY_SHAPE = {"load_weights", "tensors_of", "read_tensors", "folded_weights"}


def alphabet() -> set[str]:
    (rule,) = re.findall(r"- Shapes have one alphabet: (.*?)\n-|$", RULES, flags=re.DOTALL)[:1]
    return {letter for group in re.findall(r"`([A-Za-z ]+)`", rule) for letter in group.split()}


def functions(path: Path) -> Iterator[ast.FunctionDef]:
    """The functions of a file, those inside others aside, that take or give arrays."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            arguments = [*node.args.args, *node.args.kwonlyargs]
            notes = [each.annotation for each in arguments] + [node.returns]
            if any(kind in ast.unparse(note) for note in notes if note for kind in ARRAYS):
                yield node


CASES = [(path, node) for path in sorted(FOLDER.glob("*.py")) for node in functions(path)]
ELSEWHERE = [
    (path, node)
    for part in ("interp", "search", "place", "export", "paint", "api")
    for path in sorted((FOLDER.parent / part).rglob("*.py"))
    for node in functions(path)
    if not node.name.startswith("_")
]


@pytest.mark.parametrize(("path", "node"), ELSEWHERE, ids=lambda value: getattr(value, "name", ""))
def test_a_public_function_on_arrays_tells_their_shapes_in_every_part(
    path: Path, node: ast.FunctionDef
) -> None:
    assert re.search(r"\[[^\[\]]+\]", ast.get_docstring(node) or ""), f"{path}: {node.name} tells no shape"


def test_the_alphabet_is_written_down() -> None:
    assert {"N", "C", "H", "W", "h", "w", "n"} <= alphabet()
    assert len(CASES) > 60


@pytest.mark.parametrize(("path", "node"), CASES, ids=lambda value: getattr(value, "name", ""))
def test_a_function_on_arrays_tells_their_shapes(path: Path, node: ast.FunctionDef) -> None:
    told = ast.get_docstring(node) or ""
    shapes = re.findall(r"\[([^\[\]]*)\]", told)
    assert shapes or node.name in OF_ANY_SHAPE, f"{path.name}: {node.name} tells no shape"
    letters = set(re.findall(r"(?<![\w.])[A-Za-z](?![\w.])", " ".join(shapes)))
    # [y, x] is a place in an array, not a shape
    assert letters <= alphabet() | {"x", "y"}, f"{path.name}: {node.name}"
