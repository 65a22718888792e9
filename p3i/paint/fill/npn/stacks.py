"""The stack of a hidden cell: other cells' patches, the likest first, shifted and in the hidden cell's light.

All cells are compared with all asked for at once: what a gain and an offset leave of a difference follows
from sums over pixels, which are products of matrices. Those that are kept are shifted by the little that the
program is off (Lucas and Kanade, IJCAI 1981), and weighed by least squares on what is seen round the hole.

Convention: B cells asked for, N in the pool, K kept; patches [.., C, h, w] in 0..1; masks are 0 or 1.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from p3i.paint.fill.npn.cells import Cells, laid
from p3i.paint.fill.npn.network import Batch
from p3i.vision.warp import sample

MOST_SOURCES = 12
"""So many cells are laid upon a hidden one at most."""
# Cells are taken from so many, those nearest to what is hidden.
_MOST_POOL = 256
# Of those tried at first, this many times as many as are kept; none is kept with a misfit this many times the
# best's and more.
_TRIED, _WORSE, _WORSE_ANYWAY = 2, 1.6, 0.002
# A source shows this share of what is hidden.
_LEAST_SHOWN = 0.25
# The nearer to the hole, the more a place tells of it: to 1/e over this share of the distance to the next
# object.
_FADING = 0.25
# Gains lie between these, drawn to 1 as if by that share of the variance and that much besides.
_GAINS, _PRIOR, _PRIOR_VARIANCE = (0.5, 2.0), 0.1, 1e-3
# Differences of this size count half as much as small ones in finding a shift; it is sought so many times,
# up to this share of the distance to the next object.
_ROBUST, _SHIFTS, _FINE_SHIFTS, _MOST_SHIFT = 0.02, 3, 2, 0.12
# How far weights are drawn to the sources' own misfits: a share of the mean square of what is left.
_RIDGE = 0.3
_LEAST_WEIGHT = 1e-4
# Far from any other, a cell is in other light: so much is added to a misfit for each distance between cells.
_FARTHER = 2e-4
# With fewer pixels than this round a hole nothing is said by them.
_FEWEST = 12.0
# The rim on which the fill hangs, in pixels; what it lacks is carried over these shares of the distance
# between cells, limited.
_RIM_PX, _SCALES, _MOST_CARRIED = 2, (0.06, 0.125, 0.25, 0.5), 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Pool:
    """The cells that sources are taken from: `numbers` [N], `patches` [N, 3, h, w], `known` [N, 1, h, w]."""

    numbers: Tensor
    patches: Tensor
    known: Tensor


@dataclass(frozen=True, slots=True, eq=False)
class Laid:
    """Where the sources of a batch lie: `views` [B, K, 3, 3] reduced photo from patch, `gains` and `offsets`
    [B, K, 3] that bring their colours to the hole's light."""

    views: Tensor
    gains: Tensor
    offsets: Tensor


def pool_of(cells: Cells, near: Tensor) -> Pool:
    """The cells of which at least half is known, those nearest to the objects `near` [T] first."""
    finite = torch.isfinite(cells.views).all(-1).all(-1).nonzero()[:, 0]
    centers = torch.from_numpy(cells.centers).to(cells.device)
    away = torch.cdist(centers[finite], centers[near]).amin(1)
    # Twice as many as are kept are looked at: some are hidden, or lie beyond the frame.
    numbers = finite[away.argsort(stable=True)[: 4 * _MOST_POOL]]
    patches, known = cells.read(cells.views[numbers])
    own = torch.from_numpy(cells.cell).to(cells.device)
    share = (known[:, 0] * own).sum((1, 2)) / own.sum()
    kept = (share >= 0.5).nonzero()[:_MOST_POOL, 0]
    return Pool(numbers[kept], patches[kept], known[kept])


def stacks_of(
    cells: Cells,
    pool: Pool,
    numbers: Tensor,
    holes: Tensor,
    *,
    asked: Tensor | None = None,
    most: int = MOST_SOURCES,
) -> tuple[Batch, Laid, Tensor]:
    """The stacks of the cells `numbers` [B] with `holes` [B, 1, h, w]: the batch, where its sources lie, and
    which [B] have any.

    Outside the hole the cells are looked at where they are shown; inside, never but for the truth in
    `target`. `asked` [B, 1, h, w] is what counts of a hole, all of it by default.
    """
    targets, shown = cells.read(cells.views[numbers], shown=True)
    context = shown * (1 - holes)
    near = context * _nearness(holes, _FADING * cells.pitch_px)
    rank, able = _ranked(cells, pool, numbers, targets, near, holes)
    tried = rank.topk(min(_TRIED * most, rank.shape[1]), dim=1, largest=False).indices
    views, present = cells.views[pool.numbers[tried]], able.gather(1, tried)
    found, lit, known = _aligned(cells, targets, near, views, present, steps=_SHIFTS)
    misfit = _misfit(lit, targets, near, known)
    order = torch.where(present > 0, misfit, 1e3).topk(min(most, tried.shape[1]), dim=1, largest=False)
    kept, rows = order.indices, torch.arange(len(numbers), device=cells.device)[:, None]
    lit, known, present = lit[rows, kept], known[rows, kept], present.gather(1, kept)
    # Where nothing is told of them, all are alike.
    present = present * (order.values <= _WORSE * order.values[:, :1] + _WORSE_ANYWAY)
    found = Laid(found.views[rows, kept], found.gains[rows, kept], found.offsets[rows, kept])
    known = known * (1 - _own_ground(cells, found.views, numbers, holes))
    present = present * (
        ((known * holes[:, None]).sum((2, 3, 4)) / holes.sum((1, 2, 3))[:, None].clamp(min=1)) > 0.1
    )
    known = known * present[:, :, None, None, None]
    trust = _trusted(lit, targets, near, known, present)
    batch = Batch(
        targets,
        holes,
        context,
        lit,
        torch.zeros_like(targets),
        known,
        torch.where(present > 0, trust.clamp(min=_LEAST_WEIGHT), 0.0),
        holes if asked is None else asked,
    )
    batch = replace(batch, lift=_lift(batch, cells.pitch_px))
    return batch, found, present.sum(1) > 0


def finer(found: Laid, batch: Batch, cells: Cells, fine: Cells, numbers: Tensor) -> Laid:
    """The same sources of cells `numbers` [B] laid more exactly, on patches with more pixels."""
    size = (fine.patch.height, fine.patch.width)
    # A pixel wider, that nothing of the hole is mixed in.
    holes = F.interpolate(F.max_pool2d(batch.hole, 3, 1, 1), size, mode="nearest")
    targets, shown = fine.read(fine.views[numbers], shown=True)
    near = shown * (1 - holes) * _nearness(holes, _FADING * fine.pitch_px)
    to_fine = torch.from_numpy(fine.from_photo @ np.linalg.inv(cells.from_photo)).to(cells.device)
    views = to_fine @ found.views @ fine.to_coarse
    return _aligned(fine, targets, near, views, (batch.weights > 0).float(), steps=_FINE_SHIFTS)[0]


def _aligned(
    cells: Cells, targets: Tensor, near: Tensor, views: Tensor, present: Tensor, *, steps: int
) -> tuple[Laid, Tensor, Tensor]:
    """Sources under `views` [B, K, 3, 3] shifted to what is `near` the holes: where they lie then, their
    patches in that light, and where they are known."""
    shifts = torch.zeros(*present.shape, 2, dtype=views.dtype, device=views.device)
    reach = _MOST_SHIFT * cells.pitch_px
    found, lit, known = _lit(cells, targets, near, views, present)
    for _ in range(steps):
        step = _step(lit, targets[:, None] - lit, near[:, None] * known)
        shifts = (shifts + step.to(shifts.dtype)).clamp(-reach, reach)
        found, lit, known = _lit(cells, targets, near, views @ _shift(shifts), present)
    return found, lit, known


def _lit(
    cells: Cells, targets: Tensor, near: Tensor, views: Tensor, present: Tensor
) -> tuple[Laid, Tensor, Tensor]:
    """Sources read where `views` lay them: that in their light, their patches in it, and where they are
    known."""
    sources, known = cells.read(views)
    known = known * present[:, :, None, None, None]
    gains, offsets = _light(sources, targets[:, None], near[:, None] * known)
    lit = gains[..., None, None] * sources + offsets[..., None, None]
    return Laid(views, gains, offsets), lit, known


def _ranked(
    cells: Cells, pool: Pool, numbers: Tensor, targets: Tensor, near: Tensor, holes: Tensor
) -> tuple[Tensor, Tensor]:
    """How unlike each of the pool is to each cell round its hole [B, N], the least first, and which can
    serve."""

    def flat(values: Tensor) -> Tensor:
        return values.flatten(-2)

    known, weight, hole = (
        flat(pool.known)[:, 0].T,
        flat(near)[:, 0],
        flat(holes)[:, 0],
    )  # [P, N], [B, P], [B, P]
    total = (weight @ known).clamp(min=1e-6)
    square = torch.zeros_like(total)
    for channel in range(3):
        theirs = flat(pool.patches)[:, channel].T * known
        wanted = flat(targets)[:, channel]
        mean, wanted_mean = weight @ theirs / total, (weight * wanted) @ known / total
        variance = (weight @ (theirs * theirs) / total - mean**2).clamp(min=0)
        wanted_variance = ((weight * wanted**2) @ known / total - wanted_mean**2).clamp(min=0)
        together = (weight * wanted) @ theirs / total - mean * wanted_mean
        gain = _gain(together, variance)
        square += (wanted_variance - 2 * gain * together + gain**2 * variance).clamp(min=0) / 3
    centers = torch.from_numpy(cells.centers).to(cells.device)
    far = torch.cdist(centers[numbers], centers[pool.numbers])
    # In steps of the least distance between objects of the pool.
    far = (far / far.masked_fill(far <= 0, torch.inf).amin().clamp(min=1e-9)).float()
    told = total > _FEWEST
    misfit = torch.where(told, square.sqrt(), 0.5) + _FARTHER * far
    shown = hole @ known / hole.sum(1, keepdim=True).clamp(min=1)
    able = (shown >= _LEAST_SHOWN) & (pool.numbers[None] != numbers[:, None])
    # Where hardly any of the hidden is shown a source helps little, however well it fits.
    rank = misfit / shown.clamp(min=_LEAST_SHOWN).sqrt()
    return torch.where(able, rank, 1e3), able.float()


def _gain(together: Tensor, variance: Tensor) -> Tensor:
    prior = _PRIOR * variance + _PRIOR_VARIANCE
    return ((together + prior) / (variance + prior)).clamp(*_GAINS)


def _light(sources: Tensor, targets: Tensor, weights: Tensor) -> tuple[Tensor, Tensor]:
    """The gains and offsets [B, K, 3] that bring sources [B, K, 3, h, w] closest to targets; 1 and 0 where
    little is seen."""
    total = weights.sum((-1, -2)).clamp(min=1e-6)

    def mean_of(values: Tensor) -> Tensor:
        return (values * weights).sum((-1, -2)) / total

    mean, wanted = mean_of(sources), mean_of(targets.expand_as(sources))
    variance = (mean_of(sources**2) - mean**2).clamp(min=0)
    together = mean_of(sources * targets) - mean * wanted
    told = total / (total + _FEWEST)
    gain = 1 + told * (_gain(together, variance) - 1)
    return gain, told * (wanted - gain * mean)


def _shift(shifts: Tensor) -> Tensor:
    """Matrices [..., 3, 3] of shifts [..., 2]."""
    found = torch.eye(3, dtype=shifts.dtype, device=shifts.device).expand(*shifts.shape[:-1], 3, 3).clone()
    found[..., :2, 2] = shifts
    return found


def _step(lit: Tensor, residual: Tensor, weights: Tensor) -> Tensor:
    """The shift [B, K, 2] that lessens the residual [B, K, 3, h, w] of the sources: one robust step."""
    slopes = [
        F.pad((lit[..., 2:] - lit[..., :-2]) / 2, (1, 1)),
        F.pad((lit[..., 2:, :] - lit[..., :-2, :]) / 2, (0, 0, 1, 1)),
    ]
    # Beside what is unknown a slope is made of it.
    bare = F.max_pool2d((weights <= 0).float().flatten(0, 1), 3, 1, 1).unflatten(0, weights.shape[:2])
    robust = weights * (1 - bare) / (residual.abs() + _ROBUST)
    xx, yy, xy = (
        (robust * one * other).sum((2, 3, 4))
        for one, other in ((slopes[0], slopes[0]), (slopes[1], slopes[1]), (slopes[0], slopes[1]))
    )
    ridge = 1e-3 * (xx + yy) + 1e-6
    xx, yy = xx + ridge, yy + ridge
    bx, by = ((robust * one * residual).sum((2, 3, 4)) for one in slopes)
    over = xx * yy - xy * xy
    return torch.stack([(yy * bx - xy * by) / over, (xx * by - xy * bx) / over], -1)


def _own_ground(cells: Cells, views: Tensor, numbers: Tensor, holes: Tensor) -> Tensor:
    """1 where a source [B, K, 1, h, w] shows the very ground that its hole hides."""
    count, kept = views.shape[:2]
    width, height = cells.patch.width, cells.patch.height
    back = torch.linalg.inv(cells.views[numbers])[:, None] @ views
    points, front = laid(back, cells.patch)
    inside = front & (points > -1).all(-1) & (points[..., 0] < width) & (points[..., 1] < height)
    # The holes one below the other as one picture, a bare line between any two.
    tall = F.pad(holes, (0, 0, 0, 1)).reshape(1, -1, width)
    down = torch.arange(count, device=views.device)[:, None, None, None] * (height + 1)
    limits = torch.tensor([width - 1.0, float(height)], device=views.device)
    points = torch.minimum(points.clamp(min=0), limits)
    points = torch.stack([points[..., 0], points[..., 1] + down], -1)
    hidden = sample(tall, points)[..., 0]
    return ((hidden > 1e-3) & inside).float().reshape(count, kept, 1, height, width)


def _misfit(lit: Tensor, targets: Tensor, near: Tensor, known: Tensor) -> Tensor:
    """The mean difference [B, K] of each source from what is round the hole; as much for all where little
    is."""
    weights = near[:, None] * known
    total = weights.sum((2, 3, 4))
    apart = ((lit - targets[:, None]).abs() * weights).sum((2, 3, 4)) / (3 * total.clamp(min=1e-6))
    return torch.where(total > _FEWEST, apart, 0.1)


def _trusted(lit: Tensor, targets: Tensor, near: Tensor, known: Tensor, present: Tensor) -> Tensor:
    """How much each source counts, [B, K], together 1: least squares, drawn to trust by misfit."""
    weights = near[:, None] * known
    residual = (lit - targets[:, None]) * weights.sqrt()
    seen = weights.sum((2, 3, 4))
    misfit = torch.where(seen > _FEWEST, (residual**2).sum((2, 3, 4)) / (3 * seen.clamp(min=1e-6)), 0.05**2)
    prior = present / (misfit + 1e-5)
    prior = prior / prior.sum(1, keepdim=True).clamp(min=1e-9)
    rows = residual.flatten(2)
    products = rows @ rows.transpose(1, 2) / (3 * near.sum((1, 2, 3)).clamp(min=1e-6))[:, None, None]
    count = present.sum(1).clamp(min=1)
    ridge = _RIDGE * products.diagonal(dim1=1, dim2=2).sum(1) / count + 1e-7
    # A place without a source gets no say.
    eye = torch.eye(lit.shape[1], device=lit.device)
    normal = products + eye * (ridge[:, None] + 1e6 * (1 - present))[:, None, :]
    wanted = torch.stack([ridge[:, None] * prior, present], -1)
    solved = torch.linalg.solve(normal.double(), wanted.double()).float()
    towards, even = solved.unbind(-1)
    missing = (1 - towards.sum(1)) / even.sum(1).clamp(min=1e-9)
    found = (towards + even * missing[:, None]).clamp(min=0) * present
    return found / found.sum(1, keepdim=True).clamp(min=1e-9)


def _nearness(holes: Tensor, fading_px: float) -> Tensor:
    """How near to the hole [B, 1, h, w] a place is: 1 beside it, falling to 0."""
    reach = max(1.0, fading_px)
    wide = _blurred(holes, reach) / _blurred(torch.ones_like(holes), reach)
    return (2 * wide).clamp(min=0.02, max=1)


def _lift(batch: Batch, pitch_px: float) -> Tensor:
    """What the rim of each hole lacks in the sources' weighted mean, carried inwards [B, 3, h, w]."""
    share = batch.weights[:, :, None, None, None] * batch.known
    total = share.sum(1)
    mean = (share * batch.sources).sum(1) / total.clamp(min=1e-6)
    near = F.max_pool2d(batch.hole, 2 * _RIM_PX + 1, 1, _RIM_PX)
    rim = near * batch.context * (total > 0.3)
    off = (batch.target - mean).clamp(-_MOST_CARRIED, _MOST_CARRIED) * rim
    carried, weight = torch.zeros_like(off), torch.zeros_like(rim)
    for scale in _SCALES:
        sigma = max(0.7, scale * pitch_px)
        carried = carried + _blurred(off, sigma) / scale
        weight = weight + _blurred(rim, sigma) / scale
    return carried * (weight / 1e-3).clamp(max=1) / weight.clamp(min=1e-9)


def _blurred(values: Tensor, sigma: float) -> Tensor:
    """Patches [..., h, w] under a Gaussian, as two products of matrices; 0 beyond their edge."""

    def along(length: int) -> Tensor:
        at = torch.arange(length, dtype=values.dtype, device=values.device)
        rows = torch.exp(-0.5 * ((at[:, None] - at) / sigma) ** 2)
        return rows / (sigma * 2.5066)

    return along(values.shape[-2]) @ values @ along(values.shape[-1])
