"""The paper's own recipe."""

import numpy as np
import pytest
import torch

import p3i
from p3i.evaluation.program_scenes import program_scene
from p3i.interp.compile import compile
from p3i.search.config import SearchConfig
from p3i.search.judge.evaluate import evaluate
from p3i.search.look.evidence import COARSE, Evidence
from p3i.search.propose import paper
from p3i.size import Size

# Its loops reach beyond the picture on all sides.
LATTICE = (
    "SetCameraPose(rx=-20, ry=8)\nfor i in range(-12, 13):\n    for j in range(-12, 13):\n"
    "        Draw(x=20*i + 2*j, y=-4*i + 18*j)\n"
)
NUMBERS = [-20.0, 8.0, 20.0, -4.0, 2.0, 18.0]


def scene():
    return program_scene(p3i.loads(LATTICE), 0, look="tile", size=Size(320, 240))


def test_equation_2_is_the_sum_that_score_prints() -> None:
    image = scene().image()
    config = SearchConfig(features="rgb")
    evidence = Evidence(image, config, 35.0)
    numbers = torch.tensor([NUMBERS], dtype=torch.float64)
    loss = paper.equation2(evidence, evidence.features(COARSE), numbers)
    assert len(compile(p3i.loads(LATTICE)).index) == 625
    assert float(loss) == pytest.approx(evaluate(image, p3i.loads(LATTICE), config).equation2, rel=1e-3)


def test_its_gradient_is_that_of_finite_differences() -> None:
    evidence = Evidence(scene().image(), SearchConfig(features="rgb"), 35.0)
    features = evidence.features(COARSE)
    numbers = torch.tensor([NUMBERS], dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(paper.equation2(evidence, features, numbers).sum(), numbers)
    step = 2e-3 * torch.eye(6, dtype=torch.float64)
    around = paper.equation2(evidence, features, torch.cat([numbers + step, numbers - step])).detach()
    numeric = (around[:6] - around[6:]) / 4e-3
    assert float(torch.cosine_similarity(slope[0], numeric, dim=0)) > 0.9


def test_the_recipe_answers_the_same_twice_and_fills_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "LOOKED_AT", 200)
    monkeypatch.setattr(paper, "DESCENTS", 4)
    first, again = (p3i.synth(scene().image(), recipe="paper") for _ in range(2))
    assert first.program is not None and again.program is not None
    assert p3i.dumps(first.program) == p3i.dumps(again.program)
    assert first.features == "rgb"
    found = np.array(first.centers)[:, :2]
    assert found.min() < 160 and (found.max(axis=0) > (160, 120)).all()


def test_descent_lowers_the_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, "LOOKED_AT", 200)
    monkeypatch.setattr(paper, "DESCENTS", 4)
    losses: dict[int, float] = {}
    for steps in (0, 20):
        monkeypatch.setattr(paper, "STEPS", steps)
        seen: list[float] = []
        note = lambda step, seen=seen: seen.append(-step["worth"]) if "worth" in step else None  # noqa: E731
        p3i.synth(scene().image(), recipe="paper", trace=note)
        losses[steps] = min(seen)
    assert losses[20] < losses[0]
