"""How each form of pattern is spelled as a sketch, and the fillings that proposers write.

Of a filling the counts and bounds are written and all else is to be found: bounds stand for the draws of one
guess, and guards come when it is known which objects are there.
"""

from dataclasses import replace
from functools import cache

import torch

from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.search.forms.filling import Filling, only_filling, standing

LATTICE = "Draw(x=??*i + ??*j + ??, y=??*i + ??*j + ??)"


def spelled(draw: str, *, guards: int = 0, **bounds: str) -> Sketch:
    """The sketch of any camera, loops with `bounds` by their variables, the first outermost, and guards."""
    lines = [f"for {variable} in range({ends}):" for variable, ends in bounds.items()]
    lines += ["if ??*i + ??*j >= ??:"] * guards + [draw]
    body = "".join("    " * depth + line + "\n" for depth, line in enumerate(lines))
    sketch = parse_sketch("SetCameraPose(rx=??, ry=??)\n" + body)
    assert isinstance(sketch, Sketch), sketch
    return sketch


def curve(radius: str, angle: str, *, phase: bool = True, moves: bool = False) -> str:
    """What draws on circles of a radius, at an angle from the `phase` on; their centre `moves` with i."""
    angle += " + ?a" if phase else ""
    x, y = ("?d*i + ?x", "?e*i + ?y") if moves else ("?x", "?y")
    return f"Draw(x={radius}*Cos({angle}) + {x}, y={radius}*Sin({angle}) + {y})"


@cache
@torch.inference_mode(False)  # what is kept must serve searches by gradients too
def lattice_filling() -> Filling:
    """The sketch of a lattice; which of its cells are drawn, its fit and its extent say."""
    return only_filling(spelled(LATTICE, i="0, 2", j="0, 2"))


@cache
@torch.inference_mode(False)
def ring_filling(count: int, *, drawn: int | None = None, first: int = 0, phase: bool = True) -> Filling:
    """The sketch of a ring of `count` objects; of `drawn` objects side by side where it is not closed.

    j counts from `first`; without a `phase`, as in Table 1, from the angle 0.
    """
    step, number = (f"360/{count}*j", count) if drawn is None else ("?s*j", drawn)
    return only_filling(spelled(curve("?r", step, phase=phase), j=f"{first}, {first + number}"))


def rings_filling(
    first: int, stop: int, count: int, *, fan: bool, grows: bool, moves: bool, table1: bool = False
) -> Filling:
    """The sketch of rings i from `first` until before `stop`, of `count` objects each, or `count*i` (`fan`).

    Their radius `grows` with i, or their centre `moves` with it. In `table1` the radius is a multiple of i,
    and the angle has no phase.
    """
    radius = ("?b*i" if table1 else "(?b*i + ?r)") if grows else "?r"
    step, number = ("?s*j", f"{count}*i") if fan else (f"360/{count}*j", f"{count}")
    draw = curve(radius, step, phase=not table1, moves=moves)
    return only_filling(spelled(draw, i=f"{first}, {stop}", j=f"0, {number}"))


def with_rings(filling: Filling, *, first: int, stop: int) -> Filling:
    """The same sketch with rings from `first` until before `stop`."""
    rings = {"for_i.start.1": first, "for_i.stop.1": stop}
    more = only_filling(replace(filling.sketch, template=with_leaves(filling.sketch.template, rings)))
    return standing(more, upright=filling.pattern.upright)


def rings_of(filling: Filling) -> tuple[int, int]:
    """The first ring of a sketch of several, and the one after its last."""
    numbers = leaves(filling.sketch.template)
    return round(numbers["for_i.start.1"]), round(numbers["for_i.stop.1"])


def fan_count(filling: Filling) -> int:
    """How many more objects each ring of a fan has than the one before; 0 where all have as many."""
    return round(leaves(filling.sketch.template)["for_j.stop.i"])
