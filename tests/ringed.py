"""Searches that have found a ring already, for what starts from rings."""

from p3i.evaluation.scene import Scene
from p3i.grammar.leaves import leaves
from p3i.search.config import SearchConfig
from p3i.search.fit.places import curve_score, follow, measured, numbers_of
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.rings import FoundRing, ring_filling

MOVING = ("draw.x.radius.1", "draw.x.offset.1", "draw.y.offset.1")
FIXED = ("camera.rx", "camera.ry", "draw.x.angle.1", "draw.x.angle.j")


def session_with_ring(
    evidence: Evidence, values: dict[str, float], *, count: int, drawn: int | None = None
) -> Session:
    """A search that has found this ring, from a start a little off."""
    session = Session(evidence, SearchConfig(focal_mm=35.0))
    filling = ring_filling(count, drawn=drawn)
    off = values | {"camera.rx": values["camera.rx"] + 0.7, "camera.ry": values["camera.ry"] - 0.5}
    start = measured(evidence, filling, numbers_of(filling, off), focal_mm=35.0)
    assert start is not None
    fit = follow(evidence, start, rounds=4)
    session.rings = (FoundRing(fit, curve_score(fit), 100.0),)
    return session


def session_on(scene: Scene, *, of: int) -> Session:
    """A search on a scene of rings that has found the ring `of`, counted from the innermost or first."""
    evidence = Evidence(scene.image(), SearchConfig(focal_mm=35.0), 35.0)
    values = leaves(scene.program)
    ring = sorted(set(scene.index[:, 0].tolist()))[of]
    own = {name: values[name] + ring * values[f"{name[:-1]}i"] for name in MOVING}
    own |= {name: values[name] for name in FIXED}
    count, slots = int((scene.index[:, 0] == ring).sum()), round(360 / values["draw.x.angle.j"])
    return session_with_ring(evidence, own, count=count, drawn=None if count == slots else count)
