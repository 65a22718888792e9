"""The results of benchmarks/inpainting.py as Markdown.

A mean is over photos: of the holes of a photo first. Intervals are of the bootstrap over photos, 95 %.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from filling.holes import COMPLETIONS, KINDS

_RESAMPLES = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What one method made of one hole; the measures are those of filling/measures.py.

    `pixels` of the hole; `first`: whether the method filled it as the first of its search.
    """

    photo: str
    drawn: bool
    hole: str
    method: str
    pixels: int
    l1: float
    psnr: float
    ssim: float
    sharp: float
    sharp_pattern: float
    seam: float
    cpu_s: float
    first: bool


Value = Callable[[Row], float]


def report(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """All tables: of holes and of completions, on photos and on rendered scenes."""
    parts = []
    for title, drawn, complete in (
        ("Holes in photos", False, False),
        ("Photos completed", False, True),
        ("Holes in rendered scenes", True, False),
        ("Rendered scenes completed", True, True),
    ):
        chosen = [row for row in rows if row.drawn is drawn and (row.hole in COMPLETIONS) is complete]
        if chosen:
            parts.append(f"### {title}\n\n" + _group(chosen, [m for m in methods if _of(chosen, m)]))
    return "\n\n".join(parts)


def _group(rows: Sequence[Row], methods: Sequence[str]) -> str:
    parts = [_by_method(rows, methods), _by_kind(rows, methods)]
    others = [method for method in methods if method != "stack"]
    if "stack" in methods and others:
        parts.append(_ratios(rows, others))
        parts.append("\n".join(f"- {_against(rows, method)}" for method in others))
    return "\n\n".join(parts)


def _by_method(rows: Sequence[Row], methods: Sequence[str]) -> str:
    titles = ["method", "holes", "photos", "mean L1", "95 %", "median", "PSNR, dB", "SSIM"]
    titles += ["sharp", "of pattern", "seam", "CPU s"]
    lines = []
    for method in methods:
        mine = _of(rows, method)
        l1 = _means(mine, lambda row: row.l1)
        cpu = f"{np.mean(_means(mine, lambda row: row.cpu_s)):.2f}"
        later = [row.cpu_s for row in mine if not row.first]
        if method == "npn" and later:
            cpu += f" ({np.mean(later):.2f} after the first)"
        numbers = [
            f"{l1.mean():.1f}",
            _interval(l1[:, None]),
            f"{np.median([row.l1 for row in mine]):.1f}",
            f"{_means(mine, lambda row: row.psnr).mean():.1f}",
            f"{_means(mine, lambda row: row.ssim).mean():.2f}",
            f"{_typical(mine, lambda row: row.sharp):.2f}",
            f"{_typical(mine, lambda row: row.sharp_pattern):.2f}",
            f"{_typical(mine, lambda row: row.seam):.2f}",
        ]
        lines.append([method, str(len(mine)), str(len(l1)), *numbers, cpu])
    return _table(titles, lines)


def _by_kind(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """Mean L1 and its interval by kind of hole."""
    lines = []
    for kind in _kinds(rows):
        mine = [row for row in rows if row.hole == kind]
        l1 = [_means(_of(mine, method), lambda row: row.l1) for method in methods]
        cells = [f"{one.mean():.1f} ({_interval(one[:, None])})" if len(one) else "-" for one in l1]
        lines.append([kind, str(len({row.photo for row in mine})), *cells])
    return _table(["mean L1 of", "photos", *methods], lines)


def _ratios(rows: Sequence[Row], methods: Sequence[str]) -> str:
    """The stack's mean L1 in shares of each other method's, over the holes that both filled."""
    lines = []
    for kind in ("all", *_kinds(rows)):
        pairs = [_pairs([row for row in rows if kind in ("all", row.hole)], method) for method in methods]
        cells = [f"{_ratio(one):.2f} ({_interval(one, digits=2)})" if len(one) else "-" for one in pairs]
        lines.append([kind, *cells])
    return _table(["L1, stack / method", *methods], lines)


def _against(rows: Sequence[Row], method: str) -> str:
    """On how many photos a method is below the stack, and by how much."""
    l1 = _pairs(rows, method)
    if not len(l1):
        return f"{method}: no hole in common with the stack."
    change = 1 - l1[:, 1].mean() / l1[:, 0].mean()
    told = f"by {change:.1%} on the mean" if change > 0 else f"{-change:.1%} above it on the mean"
    stack, other = np.exp(_pairs(rows, method, lambda row: float(np.log(row.sharp))).mean(0))
    return (
        f"{method} below stack in L1 on {(l1[:, 1] < l1[:, 0]).mean():.0%} of {len(l1)} photos, {told}; "
        f"sharpness {other:.2f}, the stack's {stack:.2f}."
    )


def _of(rows: Sequence[Row], method: str) -> list[Row]:
    return [row for row in rows if row.method == method]


def _kinds(rows: Sequence[Row]) -> list[str]:
    there = {row.hole for row in rows}
    return [kind for kind in KINDS if kind in there]


def _means(rows: Sequence[Row], value: Value) -> np.ndarray:
    """The mean of a value over the holes of each photo [N]."""
    photos: dict[str, list[float]] = {}
    for row in rows:
        photos.setdefault(row.photo, []).append(value(row))
    return np.array([np.mean(values) for values in photos.values()])


def _typical(rows: Sequence[Row], value: Value) -> float:
    """The geometric mean: of ratios, twice and half make one."""
    return float(np.exp(_means(rows, lambda row: float(np.log(value(row)))).mean()))


def _pairs(rows: Sequence[Row], method: str, value: Value = lambda row: row.l1) -> np.ndarray:
    """The means by photo [N, 2] of the stack and of another method, over the holes that both filled."""
    both = []
    for name in ("stack", method):
        both.append({(row.photo, row.hole): row for row in _of(rows, name)})
    common = [key for key in both[0] if key in both[1]]
    return np.column_stack([_means([one[key] for key in common], value) for one in both])


def _ratio(means: np.ndarray) -> np.ndarray:
    """From means by photo [..., N, 1] their mean, from those of two [..., N, 2] the ratio of their means."""
    over_photos = means.mean(-2)
    if over_photos.shape[-1] == 1:
        return over_photos[..., 0]
    return over_photos[..., 0] / np.maximum(over_photos[..., 1], 1e-9)


def _interval(means: np.ndarray, *, digits: int = 1) -> str:
    """Where 95 % of the means (or ratios) over as many photos, drawn with replacement, lie."""
    drawn = np.random.default_rng(0).integers(len(means), size=(_RESAMPLES, len(means)))
    low, high = np.percentile(_ratio(means[drawn]), [2.5, 97.5])
    return f"{low:.{digits}f} to {high:.{digits}f}"


def _table(titles: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    cells = [titles, ["---"] * len(titles), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)
