"""The score is a probability: more evidence makes it higher, and it decides nothing."""

import ast
import inspect
from dataclasses import replace

import pytest

from p3i.search.judge import accept
from p3i.search.judge.probability import COEFFICIENTS, Signs, probability, terms

PLAIN = Signs(structure="lattice", bits=400.0, agreement=0.4, margin_bits=300.0, pose_sigma_deg=0.4)


@pytest.mark.parametrize(
    "better",
    [
        {"bits": 1600.0, "margin_bits": 1200.0},
        {"agreement": 0.8},
        {"pose_sigma_deg": 0.1},
        {"margin_bits": 400.0},
    ],
    ids=lambda change: next(iter(change)),
)
def test_more_evidence_makes_an_answer_likelier(better: dict[str, float]) -> None:
    assert probability(replace(PLAIN, **better)) > probability(PLAIN)


def test_a_tilt_that_nothing_fixes_is_hardly_right() -> None:
    lost = replace(PLAIN, structure="circular", bits=60.0, agreement=0.14, pose_sigma_deg=20.0)
    assert probability(lost) < 0.5 < probability(PLAIN)
    assert probability(replace(lost, pose_sigma_deg=None)) <= probability(lost)


@pytest.mark.parametrize("bits", [-1e9, 0.0, 1e-9, 1e12])
@pytest.mark.parametrize("sigma_deg", [None, 0.0, 1e9])
def test_any_signs_have_a_probability(bits: float, sigma_deg: float | None) -> None:
    odd = Signs(structure="hybrid", bits=bits, agreement=0, margin_bits=-bits, pose_sigma_deg=sigma_deg)
    assert 0 <= probability(odd) <= 1


def test_every_term_has_a_coefficient_that_was_fitted() -> None:
    assert list(terms(PLAIN)) == list(COEFFICIENTS)
    assert any(COEFFICIENTS.values())


def test_acceptance_reads_no_probability() -> None:
    """Whether there is an answer is decided by evidence; the probability is told of what was decided."""
    imported = {
        node.module
        for node in ast.walk(ast.parse(inspect.getsource(accept)))
        if isinstance(node, ast.ImportFrom)
    }
    assert not any("probability" in (module or "") for module in imported)
