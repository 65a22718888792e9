"""Rendered rings: one circle of objects, whole or open, on a plate or on bare ground."""

import dataclasses
from typing import Any

import numpy as np

from p3i.evaluation import stage
from p3i.evaluation.looks import Random
from p3i.evaluation.ring_layout import RingLayout
from p3i.evaluation.ring_painting import RingOptions, Staged, painted, random_camera, random_size, staged
from p3i.evaluation.scene import Scene

_ARCS = 0.2
"""The share of rings that are open."""


def ring_scene(seed: int, options: RingOptions | None = None, **changes: Any) -> Scene:
    """The ring of a seed under a random camera. `changes` are fields of RingOptions."""
    options = dataclasses.replace(options or RingOptions(), **changes)
    random = np.random.default_rng([seed, 1])
    plan = _plan(random, options)
    return painted(
        plan, random, options, structure="circular", seed=seed, plates=_plates(plan, random, options)
    )


def _plan(random: Random, options: RingOptions) -> Staged:
    """A ring that the picture shows well; tilts come evenly, so the rest is drawn again for each of them."""
    size = random_size(random, options)
    is_arc = random.random() < _ARCS
    while True:
        camera = random_camera(random, options)
        for _ in range(200):
            layout = _layout(random, is_arc=is_arc)
            cap = min(layout.chord() / 1.6, 0.55 * layout.radius, 14.0)
            diameter = round(float(cap * random.uniform(0.6, 1)), 2)
            plan = staged(layout, camera, size, diameter, least_seen=1.0 if random.random() < 0.8 else 0.88)
            if plan is not None:
                return plan


def _layout(random: Random, *, is_arc: bool) -> RingLayout:
    radius = float(np.exp(random.uniform(np.log(12), np.log(40))))
    slots = round(float(np.exp(random.uniform(np.log(4.6), np.log(36.4)))))
    count = slots
    if is_arc:
        slots = max(slots, 8)
        # At least two slots stay empty, so that an open ring is no ring with a gap.
        count = int(np.clip(round(slots * random.uniform(0.6, 0.88)), np.ceil(0.6 * slots), slots - 2))
    step_deg = 360 / slots
    phase = random.uniform(0, 360 if is_arc else step_deg)
    center = random.uniform(-22, 22, 2)
    return RingLayout(
        center=(round(float(center[0]), 2), round(float(center[1]), 2)),
        radius=round(radius, 2),
        step_deg=step_deg,
        count=count,
        phase_deg=round(float(phase), 2),
    )


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
