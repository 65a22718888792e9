"""Rings that are found already, for what starts from rings."""

import pytest
from drawn import DrawnRing

from p3i.evaluation.scene import Scene
from p3i.grammar.leaves import leaves
from p3i.search import synthesize
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best
from p3i.search.fit.fitted import Drawn
from p3i.search.fit.places import curve_score, follow, measured, numbers_of
from p3i.search.forms.guess import Guess
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.evidence import Evidence
from p3i.search.propose import proposers
from p3i.search.propose.proposers import AROUND

MOVING = ("draw.x.radius.1", "draw.x.offset.1", "draw.y.offset.1")
FIXED = ("camera.rx", "camera.ry", "draw.x.angle.1", "draw.x.angle.j")


def guess_of(ring: DrawnRing) -> Guess:
    """The closed ring that this one lies on, but for its phase, as a proposer says it."""
    filling = ring_filling(ring.slots)
    return Guess(filling, ring.numbers(filling, a=-ring.first_deg), 1.0, focal_mm=ring.focal_mm)


def proposes(patch: pytest.MonkeyPatch, *guesses: Guess) -> None:
    """Searches for rings begin with these guesses."""
    patch.setattr(proposers, "ring_rounds", lambda *_: iter([list(guesses)]))


def found_ring(
    evidence: Evidence, values: dict[str, float], *, count: int, drawn: int | None = None
) -> Drawn:
    """This ring as found, from a start a little off."""
    filling = ring_filling(count, drawn=drawn)
    off = values | {"camera.rx": values["camera.rx"] + 0.7, "camera.ry": values["camera.ry"] - 0.5}
    start = measured(evidence, filling, numbers_of(filling, off), focal_mm=35.0)
    assert start is not None
    fit = follow(evidence, start, rounds=4)
    return Drawn(fit.program(), fit, curve_score(fit))


def found_on(scene: Scene, *, of: int) -> Drawn:
    """The ring `of` of a scene of rings as found, counted from the innermost or first."""
    evidence = Evidence(scene.image(), SearchConfig(focal_mm=35.0), 35.0)
    values = leaves(scene.program)
    ring = sorted(set(scene.index[:, 0].tolist()))[of]
    own = {name: values[name] + ring * values[f"{name[:-1]}i"] for name in MOVING}
    own |= {name: values[name] for name in FIXED}
    count, slots = int((scene.index[:, 0] == ring).sum()), round(360 / values["draw.x.angle.j"])
    return found_ring(evidence, own, count=count, drawn=None if count == slots else count)


def searches_around(patch: pytest.MonkeyPatch, *rings: Drawn) -> None:
    """Searches look for what lies around these rings only."""
    patch.setattr(synthesize, "proposers", lambda _: (AROUND,))
    patch.setattr(Best, "rings", lambda _: list(rings))
