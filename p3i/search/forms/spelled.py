"""The sketches that proposers write, their counts written and all else to be found.

They are those of `sketches.py` but for what an extent says: bounds stand for the draws of one guess, and
guards come when it is known which objects are there.
"""

from functools import cache

from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.sketch import Sketch
from p3i.search.forms.filling import Filling, filling_of, fillings, unknowns_of

_POSE = "SetCameraPose(rx=??, ry=??)\n"
_MOST_DRAWN = 1000


@cache
def lattice_filling() -> Filling:
    """The sketch of a lattice; which of its cells are drawn, its fit and its extent say."""
    return filling_of(
        f"{_POSE}for i in range(0, 2):\n    for j in range(0, 2):\n"
        "        Draw(x=??*i + ??*j + ??, y=??*i + ??*j + ??)\n"
    )


def ring_filling(count: int, *, drawn: int | None = None, first: int = 0, phase: bool = True) -> Filling:
    """The sketch of a ring of `count` objects; of `drawn` objects side by side where it is not closed.

    j counts from `first`; without a `phase`, as in Table 1, from the angle 0.
    """
    angle = f"360/{count}*j" if drawn is None else "?s*j"
    angle += " + ?a" if phase else ""
    last = first + (count if drawn is None else drawn)
    return filling_of(
        f"{_POSE}for j in range({first}, {last}):\n    Draw(x=?r*Cos({angle}) + ?x, y=?r*Sin({angle}) + ?y)\n"
    )


def rings_filling(
    first: int, stop: int, count: int, *, fan: bool, grows: bool, moves: bool, table1: bool = False
) -> Filling:
    """The sketch of rings i from `first` until before `stop`, of `count` objects each, or `count*i` (`fan`).

    Their radius `grows` with i, or their centre `moves` with it. In `table1` the radius is a multiple of i,
    and the angle has no phase.
    """
    radius = ("?b*i" if table1 else "(?b*i + ?r)") if grows else "?r"
    angle = "?s*j" if fan else f"360/{count}*j"
    angle += "" if table1 else " + ?a"
    x, y = ("?d*i + ?x", "?e*i + ?y") if moves else ("?x", "?y")
    last = f"{count}*i" if fan else str(count)
    return filling_of(
        f"{_POSE}for i in range({first}, {stop}):\n    for j in range(0, {last}):\n"
        f"        Draw(x={radius}*Cos({angle}) + {x}, y={radius}*Sin({angle}) + {y})\n"
    )


def with_rings(filling: Filling, *, first: int, stop: int) -> Filling:
    """The same sketch with rings from `first` until before `stop`."""
    template = with_leaves(filling.sketch.template, {"for_i.start.1": first, "for_i.stop.1": stop})
    sketch = Sketch(template, filling.sketch.holes)
    return next(fillings(sketch, unknowns_of(sketch), most_indices=_MOST_DRAWN, most_settings=1))


def rings_of(filling: Filling) -> tuple[int, int]:
    """The first ring of a sketch of several, and the one after its last."""
    numbers = leaves(filling.sketch.template)
    return round(numbers["for_i.start.1"]), round(numbers["for_i.stop.1"])


def fan_count(filling: Filling) -> int:
    """How many more objects each ring of a fan has than the one before; 0 where all have as many."""
    return round(leaves(filling.sketch.template)["for_j.stop.i"])
