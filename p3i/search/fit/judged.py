"""How well the objects that a program draws predict each other on a photo: what its score is made of.

A program of rows is judged by the cells that its draws sweep (look/cells.py), those that the picture shows
whole. One that draws on a curve, or along one loop, sweeps no cells: patches about its draws are compared
instead (look/patches.py). As a lattice's cells hold all of its plane, whatever point of the cell is drawn,
so a ring is looked at in a few places of its sector beside the one that is drawn: how surely it repeats is
told where its drawing is plain, which need not be where the objects are (the wires of a dartboard, the rim
of a wheel).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import torch
from torch import Tensor

from p3i.grammar.ast import Polar
from p3i.interp.camera import project
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import nest
from p3i.search.config import FEWEST_OBJECTS, SearchConfig
from p3i.search.fit.fitted import FEWEST_SEEN
from p3i.search.fit.places import objects_about
from p3i.search.forms.lattice import Lattice, cell_px, cells_in_view, in_shortest_steps
from p3i.search.look.cells import HALF_STEPS, contrast, members, sample_grid, sample_points
from p3i.search.look.evidence import Evidence, Level
from p3i.search.look.patches import half_steps, misfit, patch_contrast, spacing
from p3i.search.look.thinned import thinned
from p3i.search.look.upright import as_it_stands

MOST_JUDGED = 600
"""More objects than this are not needed to judge a program."""
_ROUNDS = 4
# A cell as flat as a line is none.
_LEAST_AREA = 1e-6
# Cells looked for in a picture, of which MOST_JUDGED are read.
_MOST_IN_VIEW = 4000
# The places of a sector: shares of the radius that is drawn, and of the step along the curve.
_RADII = (1.0, 0.9, 0.8, 1.1)
_TURNS = (0.0, 0.5)


@dataclass(frozen=True, slots=True, eq=False)
class JudgedCells:
    """Cells `index` [N, 2] of `pattern`, the map that they were read off, and their contrast [N].

    `pattern` draws the program's points in the shortest steps, since a score is of the points, not of the
    words that tell them. `whole`: whether the cells are those that the picture shows whole; else they are all
    whose middle it shows.
    """

    pattern: Pattern
    level: Level
    index: Tensor
    contrast: Tensor
    whole: bool


@dataclass(frozen=True, slots=True, eq=False)
class JudgedPatches:
    """The contrast [N] of patches at one place of the sector; `misfit` says how far objects lie from it."""

    contrast: Tensor
    misfit: Callable[[], float]


def sweeps_cells(pattern: Pattern) -> bool:
    """Whether fractional loop indices sweep cells of the plane: rows of rows, no curves and no single row."""
    draw = nest(pattern.program).draw
    if isinstance(draw.x, Polar) or isinstance(draw.y, Polar) or len(half_steps(pattern)) < len(HALF_STEPS):
        return False
    return Lattice.of(pattern, pattern.theta).cell_area > _LEAST_AREA


def judged_cells(evidence: Evidence, pattern: Pattern) -> Iterator[JudgedCells]:
    """The cells that a program of rows draws and the photo shows, in each of the features that judge."""
    pattern = in_shortest_steps(pattern)
    seen = pattern.index[evidence.in_sight(pattern)].double()
    if len(seen) == 0:
        return
    theta = pattern.theta
    side = _side_of_middle(evidence, pattern, seen)
    for name in judging_features(evidence.config):
        level = evidence.level_for(side, name=name)
        whole = cells_in_view(level, pattern, theta, most=_MOST_IN_VIEW)
        drawn = whole[members(whole, pattern.index)]
        enough = len(drawn) >= FEWEST_OBJECTS
        index = drawn if enough else seen
        index = index[thinned(index, MOST_JUDGED)]
        found = contrast(
            level,
            pattern,
            theta,
            index,
            weights=torch.ones(len(index)),
            grid=sample_grid(),
            rounds=_ROUNDS,
        )
        yield JudgedCells(pattern, level, index, found, enough)


def _side_of_middle(evidence: Evidence, pattern: Pattern, seen: Tensor) -> float:
    """The side in photo pixels of the cell in the middle of those `seen` [N, 2], 2 at least."""
    middle = (seen.amin(0) + seen.amax(0)) / 2
    _, in_front = sample_points(evidence.frame, pattern, pattern.theta, middle[None])
    if not bool(in_front):  # a triangle's bounds may reach over the horizon
        middle = seen.median(0).values
    theta = Lattice.of(pattern, pattern.theta).moved_to(middle.numpy()).theta(pattern)
    return max(cell_px(evidence.frame, pattern, theta), 2.0)


def judging_features(config: SearchConfig) -> tuple[str, ...]:
    """The features that programs are judged by, each alone: the search's, and these with the colours."""
    names = config.features_used
    return (names,) if "rgb" in names.split("+") else (names, names + "+rgb")


def judged_patches(evidence: Evidence, pattern: Pattern) -> Iterator[JudgedPatches]:
    """The patches of a program on a curve or along one loop, at its draws and elsewhere in their sector.

    Places that fewer than three draws show are left out.
    """
    focal_mm = evidence.focal_mm
    if pattern.turning is not None:
        drawn = pattern.index[evidence.in_sight(pattern)].double()
        pattern, _ = as_it_stands(evidence, pattern, drawn, focal_mm=focal_mm)
    for theta in _places(pattern):
        index = pattern.index[evidence.in_sight(pattern, theta)].double()
        if len(index) < FEWEST_SEEN:
            continue
        index = index[thinned(index, MOST_JUDGED)]
        side = spacing(pattern, theta)
        found = patch_contrast(evidence, pattern, theta, index, side=side, focal_mm=focal_mm)
        yield JudgedPatches(found, partial(_misfit, evidence, pattern, theta, index, found, side))


def _places(pattern: Pattern) -> Iterator[Tensor]:
    """The numbers [P] that draw each place of the sector, the program's own first; rows have that only."""
    variable = pattern.turning
    if variable is None:
        yield pattern.theta
        return
    step = {0: ".angle.i", 1: ".angle.j"}[variable]
    for turn in _TURNS:
        for share in _RADII:
            theta = pattern.theta.clone()
            for place, path in enumerate(pattern.paths):
                if ".radius." in path:
                    theta[place] *= share
                elif path.endswith(".angle.1"):
                    theta[place] += turn * pattern.theta[pattern.paths.index(path[:-8] + step)]
            yield theta


def _misfit(
    evidence: Evidence, pattern: Pattern, theta: Tensor, index: Tensor, contrast: Tensor, side: float
) -> float:
    """How far the objects about the draws `index` [N, 2] lie from them; infinite where none has a place."""
    focal_mm = evidence.focal_mm
    there = objects_about(evidence, pattern, theta, index, contrast, side=side, focal_mm=focal_mm)
    if float(there.certainty.sum()) <= 0:
        return float("inf")
    here, _ = project(
        pattern.image_from_plane(theta, size=evidence.image.size, focal_mm=focal_mm),
        pattern.points_at(index, theta),
    )
    return misfit(here - there.px, whiten=there.whiten, certainty=there.certainty)
