"""docs/geometry.md tells the truth: its Python lines are run."""

import doctest
from pathlib import Path

import pytest

DOCUMENT = Path(__file__).parents[2] / "docs" / "geometry.md"


# torch.func.jacfwd loads decompositions that torch itself still scripts.
@pytest.mark.filterwarnings("ignore:`torch.jit.script` is deprecated:DeprecationWarning")
def test_the_lines_of_the_geometry_page_give_what_it_says() -> None:
    failures, tried = doctest.testfile(str(DOCUMENT), module_relative=False, encoding="utf-8")
    assert tried > 10
    assert failures == 0
