"""The record of options: every field documented, every value checked, one list of names in two places."""

import dataclasses

import pytest

from p3i.errors import UsageError
from p3i.records import fields_of
from p3i.search.config import FEATURES, SearchConfig


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(SearchConfig)])
def test_every_field_has_a_sentence_and_a_default(name: str) -> None:
    field = fields_of(SearchConfig)[name]
    assert field.sentence.endswith(".")
    assert getattr(SearchConfig(), name) == field.default


def test_the_names_of_features_are_those_of_the_extractors() -> None:
    from p3i.vision.features import DEFAULT, EXTRACTORS

    assert tuple(EXTRACTORS) == FEATURES
    assert fields_of(SearchConfig)["features"].default == DEFAULT


def test_features_may_be_joined() -> None:
    assert SearchConfig(features="oriented+lite0").features == "oriented+lite0"


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"structure": "spiral"}, "structure is one of auto, lattice, circular, hybrid, not 'spiral'"),
        ({"extent": "all"}, "extent is one of"),
        ({"features": "oriented+sift"}, "not 'sift'"),
        ({"features": "alexnet"}, "--weights FILE"),
        ({"focal_mm": float("nan")}, "focal length"),
        ({"focal_mm": 0.5}, "focal length"),
        ({"time_s": 0.0}, "more than 0 seconds"),
        ({"time_s": float("nan")}, "more than 0 seconds"),
        ({"top": 0}, "at least 1"),
        ({"threads": 0}, "at least 1"),
        ({"seed": -1}, "seed"),
    ],
)
def test_a_value_out_of_range_is_refused_with_a_reason(options: dict, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        SearchConfig(**options)
