"""The fit of the score finds the odds that made the answers; its diagram tells who promises too much."""

import importlib
import json
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_benchmarks import SCRIPTS

import p3i
from p3i.evaluation.annotations import annotation
from p3i.evaluation.scenes import scene
from p3i.evaluation.truth import truth_of
from p3i.search.judge.probability import COEFFICIENTS, Signs
from p3i.search.result import StopReason, SynthesisResult

ODDS = dict(zip(COEFFICIENTS, (-3.0, -0.5, 0.4, 3.0, 0.5, 0.0), strict=True))


@pytest.fixture
def calibration(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    monkeypatch.syspath_prepend(str(SCRIPTS[0].parent))
    return importlib.import_module("calibration")


def answers(calibration: types.ModuleType, count: int) -> tuple[list, np.ndarray]:
    """Answers of all kinds that are right as often as ODDS says, and that probability of each [N]."""
    random = np.random.default_rng(1)
    told = []
    for number in range(count):
        signs = Signs(
            structure=("lattice", "circular", "hybrid")[number % 3],
            bits=float(2 ** random.uniform(4, 11)),
            agreement=float(random.uniform(0.1, 0.9)),
            margin_bits=float(random.uniform(0, 1000)),
            pose_sigma_deg=float(2 ** random.uniform(-4, 5)),
        )
        told.append(calibration.Told("scenes", str(number), 1 + number % 2, signs, False))
    rows = calibration.rows_of(told)
    likely = 1 / (1 + np.exp(-rows @ np.array(list(ODDS.values()))))
    right = random.uniform(size=count) < likely
    return [replace(one, right=bool(is_so)) for one, is_so in zip(told, right, strict=True)], likely


def test_the_fit_finds_the_odds_that_made_the_answers(calibration: types.ModuleType) -> None:
    told, likely = answers(calibration, 3000)
    right = np.array([one.right for one in told], float)
    found = calibration.fit(calibration.rows_of(told), right, np.ones(len(told)))
    away = (found.coefficients - np.array(list(ODDS.values()))) / found.errors
    assert np.abs(away).max() < 4 and found.errors.max() < 0.5
    assert np.abs(calibration.cross_fitted(told) - likely).mean() < 0.03


def test_the_probability_of_an_answer_is_fitted_without_its_own_half(calibration: types.ModuleType) -> None:
    told, _ = answers(calibration, 300)
    flipped = [replace(one, right=not one.right) if one.fold == 1 else one for one in told]
    before, after = calibration.cross_fitted(told), calibration.cross_fitted(flipped)
    first = np.array([one.fold == 1 for one in told])
    assert np.array_equal(before[first], after[first])
    assert np.abs(before[~first] - after[~first]).mean() > 0.1


def test_the_diagram_tells_who_promises_too_much(calibration: types.ModuleType, capsys) -> None:
    told, likely = answers(calibration, 3000)
    assert calibration.diagram("honest", told, likely) < 0.03
    assert calibration.diagram("sure of all", told, np.full(len(told), 0.99)) > 0.2
    assert "| 0.9 to 1.0 | 0.99 |" in capsys.readouterr().out


def test_photos_count_as_much_as_scenes_however_few(calibration: types.ModuleType) -> None:
    told, _ = answers(calibration, 40)
    told = [replace(one, source="photos") if number < 10 else one for number, one in enumerate(told)]
    weights = calibration.weights_of(told)
    assert weights[:10].sum() == pytest.approx(weights[10:].sum()) and weights.mean() == pytest.approx(1)


def test_answers_are_read_off_the_lines_of_synth_and_held_to_the_truth(calibration: types.ModuleType) -> None:
    drawn = scene("lattice", 3)
    truth = truth_of(annotation(drawn, "a.png"))
    result = SynthesisResult(
        program=drawn.program,
        stop=StopReason.FOUND,
        structure="lattice",
        score=0.8,
        agreement=0.4,
        bits=321.0,
        margin_bits=21.0,
        pose_sigma_deg=0.3,
        centers=((1.0, 2.0, 0, 0), (3.0, 4.0, 0, 1)),
    )
    line = result.record() | {"image": "0000 a.png", "harm": "none", "truth": annotation(drawn, "a.png")}
    refused, unsure = line | {"program": None}, line | {"truth": line["truth"] | {"pose_reliable": False}}
    (told,) = calibration.told_answers("photos", [line, refused, unsure])
    assert told.right and told.fold == 1
    assert told.signs == Signs(
        structure="lattice", bits=321.0, agreement=0.4, margin_bits=21.0, pose_sigma_deg=0.3
    )
    camera = replace(drawn.program.camera, rx_deg=drawn.program.camera.rx_deg + 3)
    assert not calibration.is_right(replace(drawn.program, camera=camera), truth)


def test_a_photo_comes_as_it_is_first_and_is_spoilt_by_turns_later(
    calibration: types.ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A journal goes on where it ended, and a photo stays in its half whatever was done to it."""
    p3i.examples(tmp_path, lattices=2, rings=0, hybrids=0)
    nothing = SynthesisResult(program=None, stop=StopReason.NO_PATTERN)
    seen: list[np.ndarray] = []
    monkeypatch.setattr(p3i, "synth", lambda image: seen.append(image.pixels) or nothing)
    out = tmp_path / "journal.jsonl"
    calibration.search_photos(tmp_path, out, range(2))
    calibration.search_photos(tmp_path, out, range(12))
    records = [json.loads(line) for line in out.read_text().splitlines()]
    assert sorted(record["number"] for record in records) == list(range(12)) and len(seen) == 12
    records.sort(key=lambda record: record["number"])
    assert [record["harm"] for record in records[:2]] == ["none", "none"]
    first = {record["harm"].split()[0] for record in records[2:] if record["number"] % 2 == 0}
    assert "none" not in first and len(first) == 5
    assert {record["truth"]["file"] for record in records[::2]} == {"images/lattice_000.png"}
