"""How well any program explains any photo: equation 2 as the paper prints it, and the normalised score."""

from dataclasses import dataclass

import torch

from p3i.errors import ProgramError
from p3i.grammar.ast import Program
from p3i.interp.camera import project
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern
from p3i.interp.unroll import distinct, edges
from p3i.search.cells import HALF_STEPS, contrast, sample_grid
from p3i.search.config import SearchConfig
from p3i.search.evidence import FINE, Evidence, Level
from p3i.search.lens import scaled, straightened
from p3i.search.patches import half_steps, patch_contrast, spacing
from p3i.vision.image import Image
from p3i.vision.threads import limited_threads
from p3i.vision.warp import in_frame, sample, sample_valid

MOST_JUDGED = 600
"""More cells than this are not needed to judge a program."""
_ROUNDS = 4
# What so many cells explain, chance explains too; on a curve fewer, as there are fewer curves to choose from.
_FEW = 6
_FEW_ON_CURVE = 3
# So much agreement is found on some curve of every photo.
_CHANCE_OF_CURVE = 0.1


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A program on a photo.

    `equation2`: the paper's loss, the sum over `edges` neighbouring pairs of draws, both in sight, of the
    squared difference of their features. `normalised`: the mean over the objects in sight of how much better
    the others predict them than half a step away, less what few objects get by chance; 0 says nothing, 1 is
    perfect. It is what `synth` prints as score. `objects`: how many are in sight.
    """

    equation2: float
    edges: int
    normalised: float
    objects: int


def evaluate(image: Image, program: Program, config: SearchConfig) -> Evaluation:
    """Score a program on a photo, whatever it draws.

    The focal is that of the options, else the program's header, else the photo, else 35 mm; the lens is that
    of the header. Raises ProgramError where fewer than two of the program's objects lie in the photo.
    """
    with limited_threads(config.threads):
        return _evaluated(image, program, config)


def _evaluated(image: Image, program: Program, config: SearchConfig) -> Evaluation:
    """`evaluate`, however many threads there are."""
    header = program.header.focal_mm if program.header is not None else None
    given = None if config.focal_mm == "auto" else config.focal_mm
    focal_mm = next(mm for mm in (given, header, image.focal_mm, 35.0) if mm is not None)
    k1 = program.header.lens_k1 if program.header is not None else None
    if k1:  # judged as it was found: on the photo freed of its lens
        free = straightened(image, k1)
        image, program, focal_mm = free.image, scaled(program, 1 / free.scale), focal_mm / free.scale
    evidence = Evidence(image, config, focal_mm)
    pattern = without_doubles(compile(program))
    points, in_front = pattern.centers_px(size=image.size, focal_mm=focal_mm)
    seen = in_front & in_frame(points, image.size)
    if int(seen.sum()) < 2:
        raise ProgramError(f"{int(seen.sum())} of the program's objects lie in the photo; a score needs two")
    loss, pairs = _equation2(evidence, pattern, points, seen)
    return Evaluation(loss, pairs, normalised_score(evidence, pattern, seen), int(seen.sum()))


def normalised_score(evidence: Evidence, pattern: Pattern, seen: torch.Tensor) -> float:
    """The mean contrast of the objects in sight, less a share for few objects: `Evaluation.normalised`."""
    index = pattern.index[seen].double()
    index = index[:: len(index) // MOST_JUDGED + 1]
    steps = half_steps(pattern)
    if len(steps) < len(HALF_STEPS):  # one loop sweeps no cells: patches about the draws are compared
        side = spacing(pattern, pattern.theta)
        mm = evidence.focal_mm
        found = patch_contrast(evidence, pattern, pattern.theta, index, side=side, focal_mm=mm)
        return score_of_curve(mean_contrast(found.contrast), len(index))
    side = _cell_px(evidence, pattern, index)
    return max(
        score_of(judged_contrast(level, pattern, pattern.theta, index, half_steps=steps))
        for level in (evidence.level_for(side, name=name) for name in judging_features(evidence.config))
    )


def judging_features(config: SearchConfig) -> tuple[str, ...]:
    """The features that programs are judged by, each alone: the search's, and these with the colours."""
    names = config.features
    return (names,) if "rgb" in names.split("+") else (names, names + "+rgb")


def judged_contrast(
    level: Level,
    pattern: Pattern,
    theta: torch.Tensor,
    index: torch.Tensor,
    *,
    half_steps: torch.Tensor = HALF_STEPS,
) -> torch.Tensor:
    """The contrast [N] of the cells `index` [N, 2] of a program that is judged: all count alike at first."""
    weights = torch.ones(len(index))
    grid = sample_grid()
    found = contrast(
        level, pattern, theta, index, weights=weights, grid=grid, half_steps=half_steps, rounds=_ROUNDS
    )
    return found.contrast


def score_of(contrast: torch.Tensor) -> float:
    """The normalised score, 0 to 1, of cells with this contrast [N].

    Few cells agree by chance, and eight numbers are fitted to them.
    """
    return max(0.0, mean_contrast(contrast) * (1 - _FEW / max(len(contrast), _FEW)))


def score_of_curve(quality: float, count: int) -> float:
    """The normalised score, 0 to 1, of `count` objects on a curve; `quality` is at most their mean contrast.

    On any photo some ring can be found that agrees a little; that much is taken off, so that one limit serves
    all structures (docs/benchmarks.md says what it was calibrated on).
    """
    sure = quality * (1 - _FEW_ON_CURVE / max(count, _FEW_ON_CURVE))
    return max(0.0, (sure - _CHANCE_OF_CURVE) / (1 - _CHANCE_OF_CURVE))


def mean_contrast(contrast: torch.Tensor) -> float:
    """The mean of the contrast [N] of cells or objects, 0 where there are none.

    One that looks more like its half-way neighbour speaks against the pattern, but by half only, since
    something may lie on it.
    """
    if len(contrast) == 0:
        return 0.0
    return float((contrast.clamp(min=0) + 0.5 * contrast.clamp(max=0)).mean())


def _equation2(
    evidence: Evidence, pattern: Pattern, points: torch.Tensor, seen: torch.Tensor
) -> tuple[float, int]:
    """The loss as printed, on the features of the fine map, and the number of its pairs."""
    features = evidence.features(FINE)
    at, _ = project(features.map_from_photo, points)
    known = seen & sample_valid(features.valid, at.float())
    pairs = pattern.edges[known[pattern.edges].all(1)]
    values = sample(features.values, at.float())
    difference = values[pairs[:, 0]] - values[pairs[:, 1]]
    return float(difference.square().sum()), len(pairs)


def without_doubles(pattern: Pattern) -> Pattern:
    """The pattern with draws that coincide kept once (DESIGN.md, 2.2)."""
    centers = pattern.centers().tolist()
    kept = distinct([(x, y, 0, 0) for x, y in centers])
    if len(kept) == len(centers):
        return pattern
    live = [tuple(pair) for pair in pattern.index[kept].tolist()]
    return Pattern(
        pattern.program,
        pattern.paths,
        pattern.theta,
        pattern.index[kept],
        torch.tensor(edges(live), dtype=torch.int64).reshape(-1, 2),
    )


def _cell_px(evidence: Evidence, pattern: Pattern, index: torch.Tensor) -> float:
    """A typical distance of neighbours, in photo pixels: the size of what is compared."""
    level = evidence.frame
    matrix = level.map_from_plane(pattern, pattern.theta)
    here, front = project(matrix, pattern.points_at(index))
    steps = []
    for step in half_steps(pattern)[:2]:
        there, ahead = project(matrix, pattern.points_at(index + 2 * step))
        steps.append((there - here).norm(dim=1)[front & ahead])
    lengths = torch.cat(steps)
    typical = float(lengths.median()) if len(lengths) else 20.0
    return max(typical, 2.0) / float(level.map_from_photo[0, 0])
