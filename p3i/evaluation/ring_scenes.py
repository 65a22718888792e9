"""Rendered rings: one circle of objects, whole or open, on a plate or on bare ground."""

import dataclasses
from typing import Any

import numpy as np

from p3i.evaluation import stage
from p3i.evaluation.looks import Random
from p3i.evaluation.ring_layout import RingLayout
from p3i.evaluation.ring_painting import painted
from p3i.evaluation.ring_plan import RingOptions, Staged, planned
from p3i.evaluation.scene import Scene


def ring_scene(seed: int, options: RingOptions | None = None, **changes: Any) -> Scene:
    """The ring of a seed under a random camera. `changes` are fields of RingOptions.

    Raises UsageError where the options leave no room for a ring that can be seen well.
    """
    options = dataclasses.replace(options or RingOptions(), **changes)
    random = np.random.default_rng([seed, 1])
    plan = _plan(random, options)
    return painted(
        plan, random, options, structure="circular", seed=seed, plates=_plates(plan, random, options)
    )


def _plan(random: Random, options: RingOptions) -> Staged:
    """An open or closed ring; its count is drawn first, and evenly in its logarithm."""
    is_arc = random.random() < options.arcs
    least = 10 if is_arc else 5
    slots = round(float(np.exp(random.uniform(np.log(least - 0.4), np.log(36.4)))))
    count = slots
    if is_arc:
        # At least two slots stay empty, so that an open ring is no ring with a gap.
        count = int(np.clip(round(slots * random.uniform(0.6, 0.88)), np.ceil(0.6 * slots), slots - 2))

    def draw(random: Random) -> tuple[RingLayout, float]:
        center = random.uniform(-22, 22, 2)
        layout = RingLayout(
            center=(round(float(center[0]), 2), round(float(center[1]), 2)),
            radius=round(float(random.uniform(12, 40)), 2),
            step_deg=360 / slots,
            count=count,
            phase_deg=round(float(random.uniform(0, 360 if is_arc else 360 / slots)), 2),
        )
        cap = min(layout.chord() / 1.6, 0.5 * layout.radius, 14.0)
        return layout, round(float(cap * random.uniform(0.7, 1)), 2)

    return planned(draw, random, options, cut=0 if is_arc else 0.12)


def _plates(plan: Staged, random: Random, options: RingOptions) -> tuple[stage.Plate, ...]:
    if random.random() >= options.plates:
        return ()
    layout, diameter = plan.layout, plan.diameter
    edges = [layout.radius + diameter * random.uniform(0.65, 1.3)]
    if random.random() < 0.7:
        edges.append(layout.radius - diameter * random.uniform(0.65, 1.1))
    if random.random() < 0.7:
        edges.append(layout.radius * random.uniform(0.08, 0.25))
    edges = [edge for edge in edges if edge > 0]
    spokes = int(random.choice([0, 0, 3, 4, 5, 6, layout.count])) if len(edges) > 1 else 0
    return (
        stage.Plate(
            center=layout.center,
            edges=tuple(sorted(edges, reverse=True)),
            spokes=spokes,
            spoke_phase_deg=float(random.uniform(0, 360)),
        ),
    )
