"""How well any program explains any photo: equation 2 as the paper prints it, and the agreement.

The agreement is a function of photo and finished program (with the focal and the lens of its header) alone:
what `synth` says of its answers and what `p3i score` says. What was known besides while it was searched
only decides what it goes on with, and may refuse an answer that this would let pass.
"""

import re
from dataclasses import dataclass

import numpy as np
import torch

from p3i.errors import ProgramError
from p3i.grammar.ast import Program
from p3i.interp.camera import Camera, project
from p3i.interp.compile import compile
from p3i.interp.degenerate import refuse_edge_on, refuse_far_steps
from p3i.interp.pattern import Pattern, without_doubles
from p3i.search.config import SearchConfig
from p3i.search.fit.judged import judged_cells, judged_patches, sweeps_cells
from p3i.search.forms.whole import scaled
from p3i.search.look.contrast import mean_contrast, placed_right, score_of, score_of_curve
from p3i.search.look.evidence import FINE, Evidence
from p3i.search.look.straight import straightened
from p3i.vision.image import Image, within
from p3i.vision.threads import limited_threads
from p3i.vision.warp import sample, sample_valid


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A program on a photo.

    `equation2`: the paper's loss, the sum over `edges` neighbouring pairs of draws, both in sight, of the
    squared difference of their features. `agreement`: the mean over the objects in sight of how much better
    the others predict them than half a step away, less what few objects get by chance; 0 says nothing, 1 is
    perfect. `synth` has the same for its answers, from the finished program. `objects`: how many are in
    sight. `notes`: what a user should know of the photo, and of the program on it.
    """

    equation2: float
    edges: int
    agreement: float
    objects: int
    notes: tuple[str, ...] = ()


def evaluate(image: Image, program: Program, config: SearchConfig) -> Evaluation:
    """Score a program on a photo, whatever it draws.

    The focal is that of the options, else the program's header, else the photo, else 35 mm; the lens and the
    window of the photo that is looked at are those of the header. Raises ProgramError where fewer than two of
    the program's objects lie there, and for programs that no picture can show (p3i/interp/degenerate.py).
    """
    with limited_threads(config.threads):
        return _evaluated(image, program, config)


def _evaluated(image: Image, program: Program, config: SearchConfig) -> Evaluation:
    """`evaluate`, however many threads there are."""
    header = program.header.focal_mm if program.header is not None else None
    given = None if config.focal_mm == "auto" else config.focal_mm
    focal_mm = next(mm for mm in (given, header, image.focal_mm, 35.0) if mm is not None)
    k1 = program.header.lens_k1 if program.header is not None else None
    image = _in_window(image, program)
    evidence, program = without_lens(Evidence(image, config, focal_mm), program, k1)
    refuse_edge_on(Camera.of(program, focal_mm=evidence.focal_mm))
    pattern = without_doubles(compile(program))
    refuse_far_steps(pattern, pattern.index.numpy())
    points, in_front = pattern.centers_px(size=evidence.image.size, focal_mm=evidence.focal_mm)
    seen = in_front & evidence.part.shows(points)
    if int(seen.sum()) < 2:
        raise ProgramError(f"{int(seen.sum())} of the program's objects lie in the photo; a score needs two")
    loss, pairs = _equation2(evidence, pattern, points, seen)
    return Evaluation(loss, pairs, normalised_score(evidence, pattern), int(seen.sum()), image.notes)


def _in_window(image: Image, program: Program) -> Image:
    """The photo as the search looked at it that found the program: in the window that its header tells of."""
    facts = dict(program.header.fit) if program.header is not None else {}
    told = re.fullmatch(r"(\d{1,9}),(\d{1,9}),(\d{1,9}),(\d{1,9})", str(facts.get("window", "")))
    if told is None:
        return image
    left, top, width, height = map(int, told.groups())
    inside = np.zeros(image.valid.shape, bool)
    inside[top : top + height, left : left + width] = True
    return within(image, inside) if inside.any() else image


def score_of_program(
    evidence: Evidence,
    program: Program,
    *,
    focal_mm: float | None = None,
    lens_k1: float | None = None,
    elsewhere: bool = True,
) -> float:
    """The normalised score of a program as `evaluate` gives it, on a photo that is being looked at already.

    `focal_mm` is the program's own, None for the one that `evidence` assumes; `lens_k1` as in its header. 0
    where fewer than two objects lie in the photo. Not `elsewhere`: of a curve only what it draws counts, as
    where programs for the same objects are compared.
    """
    evidence = evidence if focal_mm is None else evidence.under(focal_mm)
    evidence, program = without_lens(evidence, program, lens_k1)
    pattern = without_doubles(compile(program))
    if int(evidence.in_sight(pattern).sum()) < 2:
        return 0.0
    return normalised_score(evidence, pattern, elsewhere=elsewhere)


def without_lens(evidence: Evidence, program: Program, k1: float | None) -> tuple[Evidence, Program]:
    """A program as it was found, and what it is judged by: the photo freed of its lens, in its units."""
    if not k1:
        return evidence, program
    free = straightened(evidence.image, k1)
    return free.looked_at(evidence), scaled(program, 1 / free.scale)


def normalised_score(evidence: Evidence, pattern: Pattern, *, elsewhere: bool = True) -> float:
    """The mean contrast of the objects in sight, less a share for few objects: `Evaluation.agreement`.

    `pattern` draws no point twice. Cells are judged in the features that show most; curves and single rows at
    the place of their sector that shows most, or, if not `elsewhere`, where they are drawn.
    """
    if sweeps_cells(pattern):
        return max((score_of(found.contrast) for found in judged_cells(evidence, pattern)), default=0.0)
    best = 0.0
    for found in judged_patches(evidence, pattern):
        mean, count = mean_contrast(found.contrast), len(found.contrast)
        if score_of_curve(mean, count) > best:
            best = max(best, score_of_curve(placed_right(mean, found.misfit()), count))
        if not elsewhere:
            break  # the program's own place is the first
    return best


def _equation2(
    evidence: Evidence, pattern: Pattern, points: torch.Tensor, seen: torch.Tensor
) -> tuple[float, int]:
    """The loss as printed, on the features of the fine map, and the number of its pairs."""
    features = evidence.features(FINE)
    at, _ = project(features.map_from_photo @ evidence.part.from_photo, points)
    known = seen & sample_valid(features.valid, at.float())
    pairs = pattern.edges[known[pattern.edges].all(1)]
    values = sample(features.values, at.float())
    difference = values[pairs[:, 0]] - values[pairs[:, 1]]
    return float(difference.square().sum()), len(pairs)
