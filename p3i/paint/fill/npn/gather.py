"""The source patches of one hole: other cells, aligned to it and matched in gain and light.

The program aligns cells to a pixel or two (paper, supplement B); what is left is found on the known
surroundings of the hole: a shift (Lucas-Kanade), a gain and an offset a channel, and how far each source can
be trusted. A membrane then carries the difference at the hole's rim smoothly inwards, for each source.

Convention: as in window.py. K sources.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from p3i.paint.fill.light import matched_light, membrane, rim_of
from p3i.paint.fill.matching import aligned, trusted, weighted_misfit
from p3i.paint.fill.npn.window import Bank, grid, project, step_px

# The surroundings that sources are weighed on reach this far, in distances between cells.
_MARGIN = 0.4
# Sources are weighed on at most so many pixels of the surroundings.
_MOST_CONTEXT = 800
# So many of the likeliest cells are aligned.
_MOST_ALIGNED = 16
# A shift is at most so many distances between cells.
_MOST_SHIFT = 0.12
# So many sources are kept even where the best is far better: the network may know a use for them.
_FEWEST = 2
# A source shows at least so much of the hole and of its surroundings, ...
_LEAST_KNOWN = 0.3
# ... and has objects near at least so much of what has them in the hole.
_LEAST_HOME = 0.6
# No source counts for nothing: the network starts from the logarithms.
_LEAST_WEIGHT = 1e-4
# The rim at which the membranes hang, in pixels of the window.
_RIM_PX = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Stack:
    """What the network sees of one hole: arrays [h, w] cover the window's core alone.

    `target` [h, w, 3] (inside the hole it is the truth where that is known, and never shown to the network),
    `hole` bool [h, w], `context` bool [h, w] (known, outside the hole), `sources` [K, h, w, 3] aligned and
    matched, `known` bool [K, h, w], `lifts` [K, h, w, 3] the membranes, `weights` [K] (sum 1), `matrices`
    [K, 3, 3] photo from window, `gains` and `offsets` [K, 3], `errors` [K] mean difference on the context.
    """

    target: np.ndarray
    hole: np.ndarray
    context: np.ndarray
    sources: np.ndarray
    known: np.ndarray
    lifts: np.ndarray
    weights: np.ndarray
    matrices: np.ndarray
    gains: np.ndarray
    offsets: np.ndarray
    errors: np.ndarray


def gather(bank: Bank, hole: np.ndarray, *, target: int = 0, most: int = 10) -> Stack | None:
    """The stack for a hole (bool [h, w]) in the window of cell number `target` of the bank, or None.

    None: nothing is known round the hole, or no other cell shows what should be in it.
    """
    window, others = bank.window, [place for place in range(len(bank.cells)) if place != target]
    context = bank.known[target] & ~hole
    margin = _MARGIN * window.pitch
    far = np.asarray(cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5))
    rows, columns = np.nonzero(context & (far <= max(margin, 4)))
    if len(rows) < 12:
        return None
    if len(rows) > _MOST_CONTEXT:
        chosen = np.linspace(0, len(rows) - 1, _MOST_CONTEXT).astype(int)
        rows, columns = rows[chosen], columns[chosen]
    closeness = np.exp(-far[rows, columns] / (0.4 * max(margin, 4))).astype(np.float32)
    wanted = bank.pixels[target][rows, columns]
    hidden = {place: _hidden(bank, hole, target, place) for place in others}
    known = {place: bank.known[place] & ~hidden[place] for place in others}
    inside = bank.home[target] & hole
    able = [
        place
        for place in others
        if known[place][hole].mean() >= _LEAST_KNOWN
        and known[place][rows, columns].mean() >= _LEAST_KNOWN
        and (not inside.any() or bank.home[place][inside].mean() >= _LEAST_HOME)
    ]
    if not able:
        return None
    rough = [
        _unlike(bank.pixels[place][rows, columns], wanted, closeness * known[place][rows, columns])
        for place in able
    ]
    likeliest = [able[place] for place in np.argsort(rough, kind="stable")[:_MOST_ALIGNED]]
    points = np.stack([columns, rows], axis=1).astype(float)
    fits = [
        _aligned(bank, place, points, wanted, closeness * known[place][rows, columns]) for place in likeliest
    ]
    order = np.argsort([fit[3] for fit in fits], kind="stable")[:most]
    worst = 1.6 * fits[order[0]][3] + 0.002
    order = [place for rank, place in enumerate(order) if rank < _FEWEST or fits[place][3] <= worst]
    return _stacked(
        bank,
        hole,
        target,
        [(likeliest[place], known[likeliest[place]], fits[place]) for place in order],
        (points, wanted, closeness),
    )


def _hidden(bank: Bank, hole: np.ndarray, target: int, place: int) -> np.ndarray:
    """Where the window of cell `place` shows the ground that the hole of cell `target` hides."""
    matrix = np.linalg.inv(bank.photo_from_window[target]) @ bank.photo_from_window[place]
    size = (bank.window.width, bank.window.height)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    # A pixel more, for the reach of cubic reading and of the shift that is still to come.
    reach = 2 * int(np.ceil(0.03 * bank.window.pitch)) + 3
    wide = cv2.dilate(hole.astype(np.uint8), np.ones((reach, reach), np.uint8)).astype(np.float32)
    return cv2.warpPerspective(wide, matrix, size, flags=flags, borderMode=cv2.BORDER_CONSTANT) > 0


def _unlike(source: np.ndarray, wanted: np.ndarray, trust: np.ndarray) -> float:
    """The mean difference that is left of `source` [K, 3] to `wanted` [K, 3] in its light."""
    gain, offset = matched_light(source, wanted, trust)
    return weighted_misfit(wanted - (gain * source + offset), trust)


def _aligned(
    bank: Bank, place: int, points: np.ndarray, wanted: np.ndarray, trust: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Shift [2] in window pixels, gain, offset and error of one source, by Lucas-Kanade."""
    matrix = bank.photo_from_window[place]
    step = step_px(matrix, bank.window)

    def read(shift: np.ndarray) -> np.ndarray:
        return bank.pyramid.read(project(matrix, points + shift), step_px=step)

    # The slopes hardly change over so short a way: they are read once.
    slopes = [read(half) - read(-half) for half in np.array([(0.5, 0.0), (0.0, 0.5)])]
    return aligned(read, lambda _: slopes, wanted, trust, most_px=_MOST_SHIFT * bank.window.pitch)


def _stacked(bank: Bank, hole: np.ndarray, target: int, chosen: list, seen: tuple) -> Stack:
    """The stack of the chosen sources: (place, known, fit) each; `seen`: context points, colours, weights."""
    points, wanted, closeness = seen
    window = bank.window
    ground = grid(window.width, window.height)
    context = bank.known[target] & ~hole
    sources, knowns, lifts, matrices, differences = [], [], [], [], []
    for place, known, (shift, gain, offset, _) in chosen:
        matrix = bank.photo_from_window[place] @ np.array([[1, 0, shift[0]], [0, 1, shift[1]], [0, 0, 1.0]])
        read = bank.pyramid.read(project(matrix, ground), step_px=step_px(matrix, window), cubic=True)
        source = (gain * read + offset).astype(np.float32)
        columns, rows = points.astype(int).T
        differences.append(np.where(known[rows, columns][:, None], source[rows, columns] - wanted, 0))
        rim = rim_of(hole, context & known, reach_px=_RIM_PX)
        lifts.append(membrane(bank.pixels[target] - source, rim, spacing_px=window.pitch))
        sources.append(source)
        knowns.append(known)
        matrices.append(matrix)
    errors = np.array([fit[3] for _, _, fit in chosen])
    core = window.core
    return Stack(
        bank.pixels[target][core],
        hole[core],
        context[core],
        np.stack([source[core] for source in sources]),
        np.stack([known[core] for known in knowns]),
        np.stack([lift[core] for lift in lifts]),
        trusted(np.stack(differences), closeness, errors, least=_LEAST_WEIGHT).astype(np.float32),
        np.stack(matrices),
        np.stack([fit[1] for _, _, fit in chosen]).astype(np.float32),
        np.stack([fit[2] for _, _, fit in chosen]).astype(np.float32),
        errors.astype(np.float32),
    )
