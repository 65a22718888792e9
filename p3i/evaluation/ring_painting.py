"""From a plan of rings to a picture: plates, objects that differ a little, gaps, things in the way."""

import cv2
import numpy as np

from p3i.evaluation import stage
from p3i.evaluation.looks import Random, texture, varied
from p3i.evaluation.ring_layout import RingLayout
from p3i.evaluation.ring_looks import DOTS, MARKS, pointed, shrunk
from p3i.evaluation.ring_plan import STRAY, RingOptions, Staged
from p3i.evaluation.scene import Scene, as_sprite, on_canvas
from p3i.interp.unroll import points
from p3i.paint.draw.sprite import lay
from p3i.search.result import StructureFound

_CONTRAST = 32.0
"""How far the colour of an object lies from that below it, in Lab."""


def painted(
    plan: Staged,
    random: Random,
    options: RingOptions,
    *,
    structure: StructureFound,
    seed: int,
    plates: tuple[stage.Plate, ...],
) -> Scene:
    """The picture of a plan, with the truth about it."""
    size, view, layout = plan.size, plan.view, plan.layout
    program = layout.program(plan.camera, size)
    places_px, index, seen = on_canvas(program, size)
    drawn = np.array(points(program), dtype=np.float64)[:, :2]
    canvas = stage.muted(texture(random, size.height, size.width), random)
    stage.add_patches(canvas, random, int(random.integers(0, options.clutter + 1)))
    stage.add_plates(canvas, view, plates, random)
    name = options.look or str(random.choice([*sorted(DOTS), *sorted(MARKS)]))
    look = _visible_look(name, random, stage.beneath(canvas, places_px[seen]))
    ends = _ends(layout, index)
    budget = int(options.hidden * seen.sum())
    gone = _left_out(ends, random, budget=budget)
    sprites = []
    for i, j in index[~gone].tolist():
        one = shrunk(varied(look, random, jitter=options.jitter), plan.share_of(i))
        if name in MARKS:
            one = pointed(one, layout.phase_deg + j * layout.step_deg)
        sprites.append(as_sprite(one))
    stray = np.clip(random.normal(0, STRAY, drawn.shape), -0.007, 0.007) * layout.chord()
    layer = lay(view, sprites, (drawn + stray)[~gone], units=plan.diameter).astype(np.float32)
    alpha = layer[..., 3:] / 255
    shadow = cv2.GaussianBlur(np.roll(alpha[..., 0], (1, 2), axis=(0, 1)), (0, 0), 2.0)[..., None]
    canvas *= 1 - 0.35 * shadow * (1 - alpha)
    canvas += alpha * (layer[..., :3] / 255 - canvas)
    covered = _covered(canvas, places_px, plan, random, ends=ends, budget=budget - int(gone.sum()))
    canvas = stage.shone_on(canvas, random)
    squeezed = random.random() < options.jpeg
    pixels, jpeg = stage.photographed(canvas, random, noise=options.noise, squeezed=squeezed)
    return Scene(
        pixels,
        program,
        places_px[seen],
        index[seen],
        name,
        seed,
        structure=structure,
        hidden=(gone | covered)[seen],
        jpeg=jpeg,
        pose_sigma_deg=plan.sigma_deg,
    )


def _visible_look(name: str, random: Random, ground: np.ndarray) -> np.ndarray:
    """A sprite of the look that stands out from the colours below, or the last of many."""
    make = DOTS.get(name) or MARKS[name]
    look = make(random)
    for _ in range(60):
        if stage.stands_out(look, ground, least=_CONTRAST):
            break
        look = make(random)
    return look


def _ends(layout: RingLayout, index: np.ndarray) -> np.ndarray:
    """The first and last objects of open arcs, bool [N]: without them a picture would not show the range."""
    if layout.closed:
        return np.zeros(len(index), bool)
    counts = layout.counts()
    last = np.array([counts[i] - 1 for i in index[:, 0].tolist()])
    return (index[:, 1] == 0) | (index[:, 1] == last)


def _left_out(ends: np.ndarray, random: Random, *, budget: int) -> np.ndarray:
    """Objects that are simply not there, bool [N]: none in most scenes, at most `budget`, and no ends."""
    gone = np.zeros(len(ends), bool)
    if budget > 0 and random.random() < 0.4:
        free = random.permutation(np.flatnonzero(~ends))
        gone[free[: int(random.integers(1, budget + 1))]] = True
    return gone


def _covered(
    canvas: np.ndarray,
    places_px: np.ndarray,
    plan: Staged,
    random: Random,
    *,
    ends: np.ndarray,
    budget: int,
) -> np.ndarray:
    """Paint something over a few objects now and then; which places it covers, bool [N].

    At most `budget`, and no ends of arcs; otherwise the canvas stays as it is.
    """
    nothing = np.zeros(len(places_px), bool)
    if budget < 1 or random.random() < 0.65:
        return nothing
    reach_px = plan.diameter * plan.size.unit_px * random.uniform(0.7, 1.3)
    target = places_px[int(random.integers(len(places_px)))] + random.normal(0, 0.4 * reach_px, 2)
    trial = canvas.copy()
    hides = stage.add_obstacle(trial, random, target, reach_px)
    height, width = hides.shape
    columns, rows = np.clip(np.rint(places_px).astype(int), 0, (width - 1, height - 1)).T
    covered = hides[rows, columns]
    if covered.sum() > budget or (covered & ends).any():
        return nothing
    canvas[:] = trial
    return covered
