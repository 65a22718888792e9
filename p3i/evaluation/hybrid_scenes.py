"""Rendered hybrids: rings around one centre, arcs that grow from ring to ring, a ring along a line."""

import dataclasses
import itertools
from typing import Any

import numpy as np

from p3i.evaluation import stage
from p3i.evaluation.looks import Random
from p3i.evaluation.ring_layout import RingLayout
from p3i.evaluation.ring_painting import painted
from p3i.evaluation.ring_plan import RingOptions, Staged, planned
from p3i.evaluation.scene import Scene

HYBRIDS = ("concentric", "fan", "row")
"""The kinds: a constant count per ring, Table 1's count `Real*i` at a fixed step, a ring along a line."""


def hybrid_scene(
    seed: int, options: RingOptions | None = None, *, kind: str | None = None, **changes: Any
) -> Scene:
    """The hybrid of a seed; `kind` is one of HYBRIDS, by default by turns.

    `changes` are fields of RingOptions. Raises UsageError as `ring_scene` does.
    """
    options = dataclasses.replace(options or RingOptions(), **changes)
    random = np.random.default_rng([seed, 2])
    kind = kind or (*HYBRIDS, "row")[seed % 4]
    plan = _plan(kind, random, options)
    return painted(
        plan, random, options, structure="hybrid", seed=seed, plates=_plates(plan, random, options)
    )


def _plan(kind: str, random: Random, options: RingOptions) -> Staged:
    make = {"concentric": _concentric, "fan": _fan, "row": _row}[kind]
    rings = int(random.choice([2, 3, 3, 4]))
    swelling = kind == "concentric" and random.random() < 0.3

    def draw(random: Random) -> tuple[RingLayout, float]:
        layout = make(random, rings)
        least = min(map(layout.radius_of, layout.counts()))
        cap = min(layout.chord() / 1.6, 0.6 * least, 12.0)
        return layout, round(float(cap * random.uniform(0.7, 1)), 2)

    return planned(draw, random, options, cut=0 if kind == "fan" else 0.1, swelling=swelling)


def _concentric(random: Random, rings: int) -> RingLayout:
    """The same count on each ring, side by side."""
    count = int(random.integers(6, 21))
    growth = float(random.uniform(5, 13))
    return RingLayout(
        center=_center(random, 14),
        radius=round(float(random.uniform(8, 24)), 2),
        growth=round(growth, 2),
        step_deg=360 / count,
        count=count,
        rings=(0, rings),
        phase_deg=round(float(random.uniform(0, 360 / count)), 2),
    )


def _fan(random: Random, rings: int) -> RingLayout:
    """Table 1's count: ring i has `count*i` objects at one step, so the arcs get longer with i."""
    count = int(random.integers(4, 8)) if rings > 2 else int(random.integers(5, 9))
    first = 2 if rings == 3 and random.random() < 0.4 else 1
    last = first + rings - 1
    # A whole part of the circle that the longest arc fills, or nearly.
    slots = count * last + int(random.choice([0, 2, 3, count]))
    in_table1 = random.random() < 0.5
    growth = float(random.uniform(7, 14))
    return RingLayout(
        center=_center(random, 14),
        radius=0.0 if in_table1 else round(float(random.uniform(0, 8)), 2),
        growth=round(growth, 2),
        step_deg=360 / slots,
        count=count,
        counted_by_ring=True,
        rings=(first, last + 1),
        phase_deg=0.0 if in_table1 else round(float(random.uniform(0, 360)), 2),
    )


def _row(random: Random, rings: int) -> RingLayout:
    """A ring that comes again along a line, clear of itself."""
    count = int(random.integers(6, 13))
    radius = float(random.uniform(7, 16))
    turn = random.uniform(0, 2 * np.pi)
    step = 2 * radius * random.uniform(1.3, 1.7)
    along = (round(float(step * np.cos(turn)), 2), round(float(step * np.sin(turn)), 2))
    middle = np.array(_center(random, 12)) - (rings - 1) / 2 * np.array(along)
    return RingLayout(
        center=(round(float(middle[0]), 2), round(float(middle[1]), 2)),
        radius=round(radius, 2),
        along=along,
        step_deg=360 / count,
        count=count,
        rings=(0, rings),
        phase_deg=round(float(random.uniform(0, 360 / count)), 2),
    )


def _center(random: Random, reach: float) -> tuple[float, float]:
    x, y = random.uniform(-reach, reach, 2)
    return round(float(x), 2), round(float(y), 2)


def _plates(plan: Staged, random: Random, options: RingOptions) -> tuple[stage.Plate, ...]:
    """One plate below rings around one centre, or one below each ring of a row."""
    if random.random() >= options.plates:
        return ()
    layout, diameter = plan.layout, plan.diameter
    rings = list(layout.counts())
    beyond, hub = diameter * random.uniform(0.65, 1.0), random.uniform(0.1, 0.3)
    if not any(layout.along):
        radii = sorted((layout.radius_of(i) for i in rings), reverse=True)
        edges = [radii[0] + beyond]
        if random.random() < 0.6:  # a change of colour between each two rings
            edges += [(outer + inner) / 2 for outer, inner in itertools.pairwise(radii)]
        edges.append(hub * radii[-1])
        return (stage.Plate(center=layout.center, edges=tuple(edges)),)
    spokes = int(random.choice([0, 0, 3, 4, layout.count]))
    edges = (layout.radius + beyond, hub * layout.radius)
    centers = [tuple(layout.center_of(i).tolist()) for i in rings]
    return tuple(stage.Plate(center=(x, y), edges=edges, spokes=spokes) for x, y in centers)
