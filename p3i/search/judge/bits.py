"""Choice: which of the programs found, of whatever structure, explains the photo best for what it costs.

Families are compared in bits (minimum description length, Rissanen 1978; the paper itself compares programs
of one structure only, by its equation 2), each program by itself:

    worth = sum over the objects in sight but one of S/2 * log2(0.9 * (1 - half + e) / (1 - whole + e)) - cost

`whole` is an object's agreement with the mean patch of the others, `half` the best agreement that this mean
reaches half a step away, so 1 - whole and 1 - half are the shares of the patch's energy that remain to be
told once it is predicted: by the program, and by the same picture without the program's places. A Gaussian
code saves half the logarithm of their ratio for each of S independent samples. e is what stays unpredictable
whatever is known, and the factor 0.9 takes off what the best of thousands of programs predicts of any picture
by chance. One object is not counted, since the mean patch itself is learnt. What a program costs: its
numbers, bounds and guards, written down to the precision that matters.

That is not all that decides. Within a family the order is its own (lattices by the share of the picture that
they explain, rings and hybrids by how surely they repeat). A hybrid that holds a ring is measured from that
ring on (`_beyond`). And what a person asked for (a sketch, a start, the paper's recipe) needs no bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from p3i.grammar.ast import Polar, Program
from p3i.grammar.leaves import leaves
from p3i.interp.compile import compile
from p3i.interp.pattern import Pattern, without_doubles
from p3i.interp.unroll import nest
from p3i.search.answer import Answer
from p3i.search.fit.judged import sweeps_cells
from p3i.search.forms.lattice import in_shortest_steps
from p3i.search.judge.accept import beyond_noise
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import SIDE, frames, patch_contrast, sample_px, spacing
from p3i.search.look.thinned import thinned

# Samples of a patch that count as independent of each other: about 7 x 7; in a small patch, pixels two apart.
_SAMPLES = 50.0
_PIXELS_APART = 2.0
# The share of a patch's energy that no program predicts: noise, light, what differs between objects.
_UNPREDICTABLE = 0.05
# The share that some program predicts on photos without a pattern, since so many are tried (as in
# look/contrast.py).
_CHANCE = 0.1
# A length or an angle is written in this many bits, a bound or a number of a guard in that many.
_NUMBER_BITS = 11.0
_WHOLE_BITS = 5.0
# A loop, a guard, a circular coordinate: which of the productions.
_PRODUCTION_BITS = 2.0
# More objects than this are judged by a part of them.
_MOST_JUDGED = 300
# Two programs draw the same object where it lies closer than this share of either spacing; a program holds
# another where it draws so much of it.
_SAME_PLACE = 0.25
_HELD = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Explained:
    """What a program explains of a photo.

    `bits`: net of its `cost`, negative where it costs more. `each` [N]: what the objects that were judged
    explain, for the `objects` in sight; `places` [N, 2] and `spacing_px` [N]: where they lie on the photo,
    and how far from the next.
    """

    bits: float
    cost: float
    objects: int
    each: Tensor
    places: Tensor
    spacing_px: Tensor


def by_explained(
    evidence: Evidence, answers: Sequence[Sequence[Answer]], *, needed: float = 0.0
) -> list[Answer]:
    """The answers of several families, each list in its own order, as one list: most bits explained first.

    Every answer's `worth` becomes what it explains. Within a family the order stays, since that family knows
    its own programs best; what is no answer (judge/accept.py: a score below `needed` and too few bits to do
    without, or none) stands in no other's way. A hybrid that holds a ring, drawing its objects and more, says
    all that the ring says, measured by it: it is worth what the ring is, and what its further objects explain
    beyond its higher cost.
    """
    told = [[(answer, explained(evidence, answer)) for answer in family] for family in answers]
    rings = [by_itself for family in told for answer, by_itself in family if answer.structure == "circular"]
    together: list[Answer] = []
    for family in told:
        most = math.inf
        for answer, by_itself in family:
            beyond = [_beyond(by_itself, ring) for ring in rings if answer.structure == "hybrid"]
            bits = max(beyond, default=-math.inf)
            bits = by_itself.bits if bits == -math.inf else bits
            worth = min(most, bits)
            together.append(replace(answer, worth=worth))
            if (answer.score >= needed and bits > 0) or beyond_noise(answer.structure, worth):
                most = worth
    return sorted(together, key=lambda answer: -answer.worth)


def explained_bits(evidence: Evidence, answer: Answer) -> float:
    """What a program explains of the photo less what it costs, in bits; negative where it costs more."""
    return explained(evidence, answer).bits


def explained(evidence: Evidence, answer: Answer) -> Explained:
    """What a program explains of the photo, object by object; nothing where fewer than two are in sight."""
    pattern = without_doubles(compile(answer.program))
    if sweeps_cells(pattern):
        pattern = in_shortest_steps(pattern)
    focal_mm = answer.focal_mm or evidence.focal_mm
    in_sight = evidence.in_sight(pattern, focal_mm=focal_mm)
    index = pattern.index[in_sight].double()
    cost = cost_bits(answer.program)
    if len(index) < 2:
        return Explained(-cost, cost, len(index), torch.zeros(0), torch.zeros(0, 2), torch.zeros(0))
    part = thinned(index, _MOST_JUDGED)
    judged = index[part]
    side = _patch_side(pattern)
    found = patch_contrast(evidence, pattern, pattern.theta, judged, side=side, focal_mm=focal_mm)
    matrix = pattern.image_from_plane(pattern.theta, size=evidence.image.size, focal_mm=focal_mm)
    side_px = SIDE * sample_px(matrix, frames(pattern, pattern.theta, judged, side=side))
    each = _bits(found.agreement, found.contrast, min(_SAMPLES, (side_px / _PIXELS_APART) ** 2))
    points, _ = pattern.centers_px(size=evidence.image.size, focal_mm=focal_mm)
    seen = points[in_sight]
    places = seen[part]
    apart = torch.cdist(places, seen)
    apart[apart < 1e-6] = math.inf
    bits = float(each.mean()) * (len(index) - 1) - cost
    return Explained(bits, cost, len(index), each, places, apart.amin(1))


def _patch_side(pattern: Pattern) -> float:
    """How wide patches are, in program units: as far as draws lie apart, on rings where they lie closest."""
    if pattern.turning != 1:
        return spacing(pattern, pattern.theta)
    centers = pattern.centers(pattern.theta)
    apart = torch.cdist(centers, centers).fill_diagonal_(math.inf).amin(1)
    rings = pattern.index[:, 0]
    return min(float(apart[rings == i].median()) for i in rings.unique())


def _bits(whole: Tensor, contrast: Tensor, samples: float) -> Tensor:
    """What each object explains [N], by its agreement with the mean patch and that beyond half a step [N]."""
    half = whole - contrast
    left, without = (1 - one.double().clamp(-1, 1) + _UNPREDICTABLE for one in (whole, half))
    return 0.5 * samples * ((1 - _CHANCE) * without / left).log2()


def _beyond(program: Explained, other: Explained) -> float:
    """What a program is worth as all that another one says and something besides; -inf where it is not."""
    if len(other.places) == 0 or program.objects <= other.objects:
        return -math.inf
    apart = torch.cdist(program.places, other.places)
    near = _SAME_PLACE * torch.minimum(program.spacing_px[:, None], other.spacing_px[None])
    same = apart < near
    if float(same.any(0).double().mean()) < _HELD:
        return -math.inf
    further = program.each[~same.any(1)]
    scale = program.objects / len(program.each)
    return other.bits + scale * float(further.sum()) - (program.cost - other.cost)


def cost_bits(program: Program) -> float:
    """The bits that a program takes to write down."""
    parts = nest(program)
    bits = _PRODUCTION_BITS * (1 + len(parts.guards) + (parts.for_i is not None) + (parts.for_j is not None))
    for form in (parts.draw.x, parts.draw.y):
        bits += _PRODUCTION_BITS * isinstance(form, Polar)
    shared: set[tuple[str, float]] = set()
    for path, value in leaves(program).items():
        if value == 0:
            continue
        if not path.startswith(("camera.", "draw.")):
            bits += _WHOLE_BITS
            continue
        # A circle's radius and angle stand in x and in y and are one number.
        name = path.replace("draw.y.", "draw.x."), value
        if ".radius." in path or ".angle." in path:
            if name in shared:
                continue
            shared.add(name)
        bits += _NUMBER_BITS
    return bits
