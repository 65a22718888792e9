"""The holes of a sketch as numbers to search: what each may be, and how numbers become a program again.

A sketch's holes fall into three kinds. Those in the camera and in `Draw` *move*: they are real numbers, and
the generator is differentiable in them. Whole numbers that stand in bounds and guards only are *extents*:
they say which indices are drawn, not where these lie. Whole numbers that stand in `Draw` too, as `?n` in
`360/?n*j`, are *counts*: each value of theirs is a generator of its own.

Convention: F moving numbers z, P numbers of theta, N indices, S settings of the extents;
theta = base + z @ ties, with base [P] and ties [F, P]; masks bool [S, N].
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.grammar.ast import Program
from p3i.grammar.departures import departures
from p3i.grammar.leaves import leaves, with_leaves
from p3i.grammar.sketch import Hole, Sketch
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import edges, live_indices, nest
from p3i.search.forms.ranges import Range, default_range
from p3i.search.look.thinned import thinned

ANGLE_DIGITS, LENGTH_DIGITS = 3, 4
"""Numbers in an answer: the camera to a thousandth of a degree, the rest to a ten-thousandth of a unit, which
is a hundredth of a pixel at the far end of a long row in a large photo."""

# So many combinations of the ends of all extents are tried at first.
_MOST_COMBINED = 256


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number to be found, at one path of the template or, under a name, at several.

    `range` says what it may be; `hard` that a person gave these limits; `start` is where to begin.
    """

    paths: tuple[str, ...]
    range: Range
    hard: bool
    start: float | None
    whole: bool

    @property
    def name(self) -> str:
        """What a trace calls it: the first of its paths."""
        return self.paths[0]

    def values(self) -> Sequence[int]:
        """The whole numbers that it may be, in order; however many, they take no room."""
        first, last = math.ceil(self.range.lower - 1e-9), math.floor(self.range.upper + 1e-9)
        return range(first, last + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Filling:
    """One setting of the counts: the generator over all indices that any extent draws, and what moves it.

    `values` are the whole numbers of the counts, `settings` those of the extents, one tuple for each row of
    `masks`, in the order of `extents`.
    """

    sketch: Sketch
    moving: tuple[Unknown, ...]
    counts: tuple[Unknown, ...]
    extents: tuple[Unknown, ...]
    values: tuple[int, ...]
    settings: tuple[tuple[int, ...], ...]
    pattern: Pattern
    base: Tensor
    ties: Tensor
    masks: Tensor

    def theta(self, z: Tensor) -> Tensor:
        """The numbers of the generator: z [..., F] -> [..., P]."""
        return self.base + z @ self.ties

    def z_of(self, theta: Tensor) -> Tensor:
        """The moving numbers that come closest to theta: [..., P] -> [..., F]; tied ones are averaged."""
        return ((theta - self.base) @ self.ties.T) / self.ties.sum(1)

    @property
    def lower(self) -> Tensor:
        """The least that each moving number may be, [F]; -inf where nobody set a limit."""
        return torch.tensor([u.range.lower if u.hard else -math.inf for u in self.moving]).double()

    @property
    def upper(self) -> Tensor:
        """The most that each moving number may be, [F]; inf where nobody set a limit."""
        return torch.tensor([u.range.upper if u.hard else math.inf for u in self.moving]).double()

    @property
    def width(self) -> Tensor:
        """The width of each moving number's range, [F]."""
        return torch.tensor([u.range.upper - u.range.lower for u in self.moving]).double()

    def named(self, z: Tensor) -> dict[str, float]:
        """The moving numbers z [F] by the names of their unknowns, such as draw.x.radius.1."""
        return {unknown.name: value for unknown, value in zip(self.moving, z.tolist(), strict=True)}

    def program(self, z: Tensor, setting: tuple[int, ...]) -> Program:
        """The sketch filled: numbers rounded as in every answer, limits kept, plain numbers as written."""
        found: dict[str, float] = {}
        for unknown, value in zip(self.moving, z.tolist(), strict=True):
            digits = ANGLE_DIGITS if unknown.name.startswith("camera.") else LENGTH_DIGITS
            if unknown.range.turns and not unknown.hard:
                value %= 360
            value = round(value, digits)
            if unknown.hard:
                value = min(max(value, unknown.range.lower), unknown.range.upper)
            found |= dict.fromkeys(unknown.paths, value)
        return self.sketch.fill(found | by_path(self.counts, self.values) | by_path(self.extents, setting))


def unknowns_of(sketch: Sketch, *, longer_units: tuple[float, float] = (100.0, 100.0)) -> list[Unknown]:
    """The numbers to be found, holes of one name as one; `longer_units`: the canvas in program units."""
    families: dict[str, list[Hole]] = {}
    for hole in sketch.holes:
        families.setdefault(f"?{hole.name}" if hole.name is not None else hole.path, []).append(hole)
    return [_unknown(holes, longer_units) for holes in families.values()]


def _unknown(holes: list[Hole], canvas: tuple[float, float]) -> Unknown:
    first = holes[0]
    paths = tuple(hole.path for hole in holes)
    # Guards are discrete, so their numbers are searched among whole ones.
    whole = any(hole.whole or hole.path.startswith("if_") for hole in holes)
    start = next((hole.start for hole in holes if hole.start is not None), None)
    ranges = [
        default_range(hole.path, whole=whole, divides=hole.over is not None, start=start, canvas=canvas)
        for hole in holes
    ]
    narrowest = min(ranges, key=lambda found: found.upper - found.lower)
    lower, upper = max(found.lower for found in ranges), min(found.upper for found in ranges)
    if lower < upper:
        narrowest = replace(narrowest, lower=lower, upper=upper)
    hard = first.lower is not None and first.upper is not None
    if hard:
        assert first.lower is not None and first.upper is not None
        narrowest = replace(narrowest, lower=first.lower, upper=first.upper)
        if first.lower <= 0 <= first.upper:
            narrowest = replace(narrowest, relative=False)
    return Unknown(paths, narrowest, hard, start, whole)


def fillings(
    sketch: Sketch, unknowns: list[Unknown], *, most_indices: int, most_settings: int
) -> Iterator[Filling]:
    """One Filling for each setting of the counts; extents are thinned out to `most_settings`, spread evenly.

    Extents that would draw more than `most_indices` are left for later (settings.py weighs them all). Where
    the least of them draws more than that, it stands for all, with so many of its objects.
    """
    counts, extents = counts_of(unknowns), extents_of(unknowns)
    whole = (*counts, *extents)
    for values in itertools.product(*(u.values() for u in counts)):
        settings: list[tuple[int, ...]] = []
        least: tuple[int, tuple[int, ...]] | None = None
        for setting in _spread(extents, most_settings):
            drawn = 2 if not extents else len(_live(sketch, by_path(whole, (*values, *setting))))
            if 2 <= drawn <= most_indices:
                settings.append(setting)
            elif drawn > most_indices and (least is None or drawn < least[0]):
                least = drawn, setting
        if settings:
            yield _filling(sketch, unknowns, values, tuple(settings))
        elif least is not None:
            full = _filling(sketch, unknowns, values, (least[1],))
            kept = thinned(full.pattern.index, most_indices)
            yield over(full, [(int(i), int(j)) for i, j in full.pattern.index[kept].tolist()])


def counts_of(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
    """The whole numbers that stand in `Draw`: each value of theirs is a generator of its own."""
    return tuple(u for u in unknowns if u.whole and any(path.startswith("draw.") for path in u.paths))


def extents_of(unknowns: Sequence[Unknown]) -> tuple[Unknown, ...]:
    """The whole numbers that stand in bounds and guards only."""
    counts = counts_of(unknowns)
    return tuple(u for u in unknowns if u.whole and u not in counts)


def draws(sketch: Sketch) -> Iterator[int]:
    """How many objects the sketch draws under one setting after another of all its whole numbers."""
    unknowns = unknowns_of(sketch)
    counts, extents = counts_of(unknowns), extents_of(unknowns)
    for values in itertools.product(*(u.values() for u in counts)):
        for setting in _spread(extents, 2):
            yield len(_live(sketch, by_path((*counts, *extents), (*values, *setting))))


def only_filling(sketch: Sketch) -> Filling:
    """The filling of a sketch whose whole numbers are all written."""
    return _filling(sketch, unknowns_of(sketch), (), ((),))


def with_settings(filling: Filling, settings: tuple[tuple[int, ...], ...]) -> Filling:
    """The same numbers with other settings of the extents."""
    unknowns = [*filling.moving, *filling.counts, *filling.extents]
    return _filling(filling.sketch, unknowns, filling.values, settings)


def pinned(filling: Filling, z: Tensor, which: Tensor) -> Filling:
    """The same filling with the numbers `which` bool [F] held where z [F] has them."""
    held = which.to(z)
    return replace(
        filling, base=filling.base + (z * held) @ filling.ties, ties=filling.ties * (1 - held)[:, None]
    )


def standing(filling: Filling, *, upright: bool) -> Filling:
    """The same filling, its objects taken to stand `upright`, or to turn with the curve."""
    return replace(filling, pattern=replace(filling.pattern, upright=upright))


def over(filling: Filling, index: list[tuple[int, int]]) -> Filling:
    """The same numbers and settings over these indices, whatever the settings draw of them."""
    masks = torch.ones(len(filling.settings), len(index), dtype=torch.bool)
    return replace(filling, pattern=_pattern_over(filling.pattern, index), masks=masks)


def _spread(extents: tuple[Unknown, ...], most_settings: int) -> Iterator[tuple[int, ...]]:
    """A few settings of the extents, from the least to the most of each: about `most_settings`, lazily."""
    each = max(2, round(most_settings ** (1 / max(len(extents), 1))))
    held = each ** len(extents) > _MOST_COMBINED
    chosen: list[Sequence[int]] = []
    for unknown in extents:
        every = unknown.values()
        if held and all(path.startswith("if_") for path in unknown.paths):
            # Too many guards to combine: each lets pass what it can.
            constant = unknown.name.endswith(".1")
            chosen.append([every[-1] if constant else min(every, key=abs)])
        elif len(every) > each:
            picks = {round(k * (len(every) - 1) / (each - 1)) for k in range(each)}
            chosen.append([every[place] for place in sorted(picks)])
        else:
            chosen.append(every)
    yield from itertools.product(*chosen)


def by_path(unknowns: Sequence[Unknown], values: Sequence[float]) -> dict[str, float]:
    """What each path of the unknowns holds where they have these values."""
    return {
        path: float(value) for unknown, value in zip(unknowns, values, strict=True) for path in unknown.paths
    }


def _set(sketch: Sketch, numbers: dict[str, float]) -> Program:
    """The template with these numbers, by their paths, in their holes."""
    filled = {hole.path: hole.leaf(numbers[hole.path]) for hole in sketch.holes if hole.path in numbers}
    return with_leaves(sketch.template, filled)


def _live(sketch: Sketch, numbers: dict[str, float]) -> list[tuple[int, int]]:
    """The indices that the sketch draws with these whole numbers, by their paths."""
    return live_indices(_set(sketch, numbers))


def _filling(
    sketch: Sketch,
    unknowns: Sequence[Unknown],
    values: tuple[int, ...],
    settings: tuple[tuple[int, ...], ...],
) -> Filling:
    moving = tuple(u for u in unknowns if not u.whole)
    counts, extents = counts_of(unknowns), extents_of(unknowns)
    numbers = [by_path((*counts, *extents), (*values, *setting)) for setting in settings]
    drawn = [_live(sketch, one) for one in numbers]
    index = sorted(set().union(*drawn))
    places = {pair: place for place, pair in enumerate(index)}
    masks = torch.zeros(len(settings), len(index), dtype=torch.bool)
    for row, pairs in enumerate(drawn):
        masks[row, [places[pair] for pair in pairs]] = True
    pattern = _pattern_over(compile(_set(sketch, numbers[-1])), index)
    ties = torch.zeros(len(moving), len(pattern.paths), dtype=torch.float64)
    for row, unknown in enumerate(moving):
        for path in unknown.paths:
            ties[row, pattern.paths.index(path)] = 1
    base = pattern.theta * (ties.sum(0) == 0)
    return Filling(sketch, moving, counts, extents, values, settings, pattern, base, ties, masks)


def _pattern_over(pattern: Pattern, index: list[tuple[int, int]]) -> Pattern:
    return replace(
        pattern,
        index=torch.tensor(index, dtype=torch.int64).reshape(-1, 2),
        edges=torch.tensor(edges(index), dtype=torch.int64).reshape(-1, 2),
    )


def start_values(filling: Filling) -> Tensor | None:
    """The moving numbers [F] where a person gave a start for all of them, else None."""
    if any(unknown.start is None for unknown in filling.moving):
        return None
    return torch.tensor([unknown.start for unknown in filling.moving], dtype=torch.float64)


def whole_program_sketch(program: Program, *, table1: bool = False) -> Sketch:
    """A program as a sketch that starts at its own numbers: camera and `Draw` free, bounds and guards kept.

    What x and y of a curve share (the radius and the angle of a circle) stays one number, and a ring does not
    become a spiral: loop coefficients that are zero inside Cos, Sin and their radius stay zero. With `table1`
    so do all numbers that Table 1 has no place for.
    """
    parts = nest(program)
    bound = {"1"} | ({"i"} if parts.for_i else set()) | ({"j"} if parts.for_j else set())
    values = leaves(program)
    holes: list[Hole] = []
    for path, value in values.items():
        kind, _, variable = path.rpartition(".")
        if path.startswith("camera."):
            holes.append(Hole(path, start=value))
        if not path.startswith("draw.") or variable not in bound:
            continue
        inner = kind.endswith((".radius", ".angle", ".offset"))
        if inner and variable != "1" and value == 0:
            continue
        if table1 and value == 0 and departures(with_leaves(program, {path: 1.0})):
            continue
        pair = path.removeprefix("draw.x.").removeprefix("draw.y.")
        shared = values.get(f"draw.x.{pair}") == values.get(f"draw.y.{pair}")
        tied = shared and kind.endswith((".radius", ".angle"))
        holes.append(Hole(path, name=pair.replace(".", "_") if tied else None, start=value))
    return Sketch(program, tuple(holes))


def kept_within(filling: Filling, z: Tensor) -> Tensor:
    """z [..., F] inside the limits that a person gave; others may run free."""
    return torch.minimum(torch.maximum(z, filling.lower), filling.upper)
