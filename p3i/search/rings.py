"""Rings on a photo: proposals, fits, which objects are there, and the program."""

import torch

from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.curves import CurveFit, follow, measured
from p3i.search.evidence import Evidence
from p3i.search.fill import Filling, fillings, unknowns_of
from p3i.search.propose.ring import RingProposal


def ring_filling(count: int, first: int = 0, last: int | None = None) -> Filling:
    """The sketch of a ring of `count` objects, of which those from `first` up to `last` are drawn."""
    angle = f"360/{count}*j + ?a"
    text = (
        "SetCameraPose(rx=??, ry=??)\n"
        f"for j in range({first}, {count + first if last is None else last}):\n"
        f"    Draw(x=?r*Cos({angle}) + ?x, y=?r*Sin({angle}) + ?y)\n"
    )
    sketch = parse_sketch(text)
    assert isinstance(sketch, Sketch), sketch
    return next(fillings(sketch, unknowns_of(sketch), most_indices=1000, most_settings=1))


def start(filling: Filling, proposal: RingProposal) -> torch.Tensor:
    """The proposal as the sketch's free numbers."""
    values = {
        "camera.rx": proposal.rx_deg,
        "camera.ry": proposal.ry_deg,
        "draw.x.radius.1": proposal.radius,
        "draw.x.angle.1": 0.0,
        "draw.x.offset.1": float(proposal.center[0]),
        "draw.y.offset.1": float(proposal.center[1]),
    }
    return torch.tensor([values[unknown.name] for unknown in filling.moving], dtype=torch.float64)


def ring_fit(evidence: Evidence, proposal: RingProposal) -> CurveFit | None:
    """The proposal refined by its objects' places."""
    filling = ring_filling(proposal.count)
    first = measured(evidence, filling, start(filling, proposal), focal_mm=proposal.focal_mm)
    return None if first is None else follow(evidence, first, rounds=5)
