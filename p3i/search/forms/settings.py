"""The extents of a sketch weighed: which whole numbers in its bounds and guards draw what is there.

The settings of all extents together may be 10^9 (two loops with free ends and two guards): they are never
listed. Where they are few, each is weighed; else the numbers of one statement after another are, all others
as they stand, from the setting that the search has reached, until none gains any more.

Convention: S settings, each a tuple in the order of `filling.extents`; indices int64 [N, 2].
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import torch
from torch import Tensor

from p3i.errors import SketchError
from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.limits import SETTINGS
from p3i.grammar.sketch import Sketch
from p3i.interp.unroll import SLACK, live_indices, nest
from p3i.search.forms.filling import Filling, Unknown, by_path, counts_of, over, unknowns_of

Setting = tuple[int, ...]

# Up to so many settings are weighed one by one; so many at a time.
_MOST_WEIGHED = 4000
_AT_A_TIME = 256
# So often the statements are gone through.
_SWEEPS = 8


def check_settings(sketch: Sketch, *, place: str) -> None:
    """Raise SketchError where the whole numbers of a sketch may be too many to look at each."""
    unknowns, limit = unknowns_of(sketch), SETTINGS.value()
    mend = f"narrow its bounds, or {SETTINGS.advice()}"
    for unknown in (one for one in unknowns if one.whole):
        if (choices := len(unknown.values())) > limit:
            reason = f"a hole in it ({unknown.name}) may be {choices:,} whole numbers; the limit is {limit:,}"
            raise SketchError(place=place, reason=reason, mend=mend)
    ways = math.prod(len(unknown.values()) for unknown in counts_of(unknowns))
    if ways > limit:
        reason = (
            f"its whole numbers in `Draw` can be chosen in {ways:,} ways, each a search of its own; "
            f"the limit is {limit:,}"
        )
        raise SketchError(place=place, reason=reason, mend=mend)


def widened(filling: Filling) -> Filling:
    """The filling over all indices that some setting may draw."""
    return over(filling, sorted(_in_reach(filling)))


def best_setting(wide: Filling, gains: Tensor, now: Setting) -> tuple[float, Setting]:
    """The setting whose draws gain most, and how much; `gains` [N] are those of the indices of `wide`."""
    extents = wide.extents
    if _ways(extents) <= _MOST_WEIGHED:
        return _best_of(wide, gains, _product(extents))
    value = _best_of(wide, gains, [now])[0]
    for _ in range(_SWEEPS):
        before = value
        for places in _by_statement(extents):
            tried = _with(now, places, [extents[place].values() for place in places])
            better, setting = _best_of(wide, gains, tried)
            if better > value:
                value, now = better, setting
        if value == before:
            break
    return value, now


def drawn_by(filling: Filling, settings: Sequence[Setting], index: Tensor) -> Tensor:
    """Which of the indices [N, 2] each setting draws, bool [S, N]: what loops and guards mean, at once."""
    numbers: dict[str, np.ndarray | float] = dict(leaves(filling.sketch.template))
    for unknowns, rows in ((filling.counts, [filling.values]), (filling.extents, settings)):
        table = np.array(rows, dtype=float).reshape(len(rows), len(unknowns))
        for column, unknown in enumerate(unknowns):
            numbers |= dict.fromkeys(unknown.paths, table[:, column, None])
    i, j = index[:, 0].numpy().astype(float), index[:, 1].numpy().astype(float)
    inside = np.ones((len(settings), len(index)), dtype=bool)

    def affine(path: str) -> np.ndarray | float:
        return numbers[f"{path}.i"] * i + numbers[f"{path}.j"] * j + numbers[f"{path}.1"]

    parts = nest(filling.sketch.template)
    for name, loop, at in (("for_i", parts.for_i, i), ("for_j", parts.for_j, j)):
        if loop is not None:
            inside &= np.ceil(affine(f"{name}.start") - SLACK) <= at
            inside &= at < np.ceil(affine(f"{name}.stop") - SLACK)
    for number in range(1, len(parts.guards) + 1):
        inside &= affine(f"if_{number}") >= -SLACK
    return torch.from_numpy(inside)


def _best_of(wide: Filling, gains: Tensor, settings: Iterable[Setting]) -> tuple[float, Setting]:
    """The first of the settings that gain most."""
    best, found = -math.inf, ()
    ahead = iter(settings)
    while some := tuple(itertools.islice(ahead, _AT_A_TIME)):
        gain = drawn_by(wide, some, wide.pattern.index).double() @ gains
        value, place = gain.max(0)
        if float(value) > best:
            best, found = float(value), some[int(place)]
    return best, found


def _by_statement(extents: tuple[Unknown, ...]) -> list[list[int]]:
    """The places of the extents that stand in one statement; of too many settings, each by itself."""
    together: dict[str, list[int]] = {}
    for place, unknown in enumerate(extents):
        together.setdefault(unknown.name.split(".")[0], []).append(place)
    groups: list[list[int]] = []
    for places in together.values():
        few = _ways(tuple(extents[place] for place in places)) <= _MOST_WEIGHED
        groups += [places] if few else [[place] for place in places]
    return groups


def _with(now: Setting, places: list[int], values: list[Sequence[int]]) -> Iterator[Setting]:
    """The setting `now` with every choice of values at these places."""
    for chosen in itertools.product(*values):
        setting = list(now)
        for place, value in zip(places, chosen, strict=True):
            setting[place] = value
        yield tuple(setting)


def _in_reach(filling: Filling) -> set[tuple[int, int]]:
    """The indices that the loops reach with each number in them the least or the most it may be."""
    guards = len(nest(filling.sketch.template).guards)
    passing = {f"if_{number}.{part}": 0.0 for number in range(1, guards + 1) for part in "ij1"}
    open_template = with_leaves(filling.sketch.template, passing)
    loops = [one for one in filling.extents if any(path.startswith("for_") for path in one.paths)]
    counted = by_path(filling.counts, filling.values)
    found: set[tuple[int, int]] = set()
    for ends in itertools.product(*({one.values()[0], one.values()[-1]} for one in loops)):
        numbers = counted | by_path(loops, ends)
        bounds = {path: value for path, value in numbers.items() if path.startswith("for_")}
        found.update(live_indices(with_leaves(open_template, bounds)))
    return found


def _ways(unknowns: Sequence[Unknown]) -> int:
    return math.prod(len(unknown.values()) for unknown in unknowns)


def _product(extents: Sequence[Unknown]) -> Iterator[Setting]:
    return itertools.product(*(unknown.values() for unknown in extents))
