"""The record of options: every field documented, every value checked, one list of names in two places."""

import dataclasses

import pytest

from p3i.errors import UsageError
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.records import fields_of
from p3i.search.config import FEATURES, STRUCTURES, SearchConfig, Structure
from p3i.search.forms.sketches import WALKED_SHAPES, every_sketch

SKETCH = parse_sketch("for j in range(0, 9):\n    Draw(x=9*j + ??, y=2*j)\n")
assert isinstance(SKETCH, Sketch)


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(SearchConfig)])
def test_every_field_has_a_sentence_and_a_default(name: str) -> None:
    field = fields_of(SearchConfig)[name]
    assert field.sentence.endswith(".")
    assert getattr(SearchConfig(), name) == field.default


def test_the_names_of_features_are_those_of_the_extractors() -> None:
    from p3i.vision.features import DEFAULT, EXTRACTORS

    assert tuple(EXTRACTORS) == FEATURES
    assert SearchConfig().features_used == DEFAULT


@pytest.mark.parametrize("features", ["oriented", "lite0", "rgb"])
def test_features_that_are_asked_for_are_used_by_every_recipe(features: str) -> None:
    assert SearchConfig(recipe="paper", features=features).features_used == features
    assert dataclasses.replace(SearchConfig(features=features), recipe="paper").features_used == features


def test_a_recipe_takes_its_own_features_and_extent_where_none_are_asked_for() -> None:
    config = dataclasses.replace(SearchConfig(), recipe="paper")
    assert (config.features_used, config.extent_used) == ("rgb", "image")
    back = dataclasses.replace(config, recipe="p3i")
    assert (back.features_used, back.extent_used) == (SearchConfig().features_used, "found")


@pytest.mark.parametrize("structure", STRUCTURES)
def test_sketches_are_walked_for_every_structure_that_may_be_asked_for(structure: Structure) -> None:
    """Else the time would be taken, and nothing said."""
    walked = any(
        one.shape in WALKED_SHAPES and structure in ("auto", one.structure) for one in every_sketch()
    )
    if walked:
        assert SearchConfig(exhaustive_s=1, structure=structure).structure == structure
    else:
        with pytest.raises(UsageError, match="contradict"):
            SearchConfig(exhaustive_s=1, structure=structure)


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
        ({"recipe": "paper", "extent": "found"}, "leave out --extent found"),
        ({"recipe": "paper", "structure": "hybrid"}, "--structure hybrid contradict"),
        ({"sketch": SKETCH, "focal_mm": "auto"}, "--sketch is fitted under one focal"),
        ({"start": SKETCH.template, "focal_mm": "auto"}, "--start is fitted under one focal"),
        ({"sketch": SKETCH, "lens": 0.1}, "leave out --lens"),
        ({"start": SKETCH.template, "lens": -0.1}, "leave out --lens"),
        ({"exhaustive_s": 3.0, "strict": True}, "leave out --strict"),
        ({"structure": "circular", "extent": "image"}, "continues lattices only"),
        ({"object": "hole"}, "the object is crossing, field, dark, light or a number from 1, not 'hole'"),
        ({"object": "0"}, "a number from 1, not '0'"),
        ({"object": "dark", "structure": "hybrid"}, "leave it out for hybrid"),
        ({"object": "dark", "strict": True}, "--strict says itself where the objects are"),
        ({"object": "dark", "recipe": "paper"}, "--recipe paper says itself where the objects are"),
        ({"object": "dark", "sketch": SKETCH}, "--sketch says itself where the objects are"),
    ],
)
def test_a_value_out_of_range_is_refused_with_a_reason(options: dict, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        SearchConfig(**options)
