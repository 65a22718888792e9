"""Where the middle of the object is: what agreement between objects cannot say.

Draws that all lie a little beside their objects look as alike as draws in their middles. The mean patch
tells: what differs in it from the ground around is the object, and its middle is sought by mean shift. Then
the program's lengths and angles, not its camera, are moved so that the draws fall there.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from p3i.interp.camera import project
from p3i.search.fit.fitted import Fit
from p3i.search.fit.places import measured
from p3i.search.fit.robust import moving_limits
from p3i.search.fit.slopes import with_slopes
from p3i.search.look.evidence import Evidence
from p3i.search.look.patches import Frames, frames, offsets_grid, sample_px
from p3i.vision.warp import sample, sample_valid

# Samples on each side of the middle, in all this many patch sides wide.
_COUNT, _WIDE = 27, 1.2
# The window of the mean shift, as a share of a patch's side, and its steps.
_WINDOW, _STEPS = 0.24, 12
# Further than this share of a patch's side nothing is moved.
_MOST = 0.3
# An object must stand out from the ground by this factor.
_STANDS_OUT = 1.5
_TURNS = 4


@dataclass(frozen=True, slots=True, eq=False)
class _MeanPatch:
    """How much each place of the mean patch differs from the ground [K], at `offsets` [K, 2] in sides."""

    offsets: Tensor
    saliency: Tensor


def centred(evidence: Evidence, fit: Fit) -> Fit:
    """The fit with its draws in the middle of their objects, as far as its free numbers allow."""
    now = fit
    for _ in range(_TURNS):
        where = frames(now.filling.pattern, now.theta, now.index, side=now.side)
        middle = _middle(_mean_patch(evidence, now, where))
        if middle is None:
            break
        z = _moved(now, where.points(middle[None, None])[:, 0])
        moved = measured(evidence, now.filling, z, focal_mm=now.focal_mm, side=now.side)
        if moved is None or moved.mean < 0.8 * fit.mean:
            break
        now = moved
    return now


def standing_out(evidence: Evidence, fit: Fit) -> float:
    """How much the middle of the mean patch differs from the ground, against what lies around it.

    Between the objects of a pattern patches look alike as well; there it is less than on the objects.
    """
    where = frames(fit.filling.pattern, fit.theta, fit.index, side=fit.side)
    return _lead(_mean_patch(evidence, fit, where))


def _lead(patch: _MeanPatch) -> float:
    near = patch.offsets.norm(dim=1) < _WINDOW
    return float(patch.saliency[near].mean()) / (float(patch.saliency[~near].mean()) + 1e-9)


def _mean_patch(evidence: Evidence, fit: Fit, where: Frames) -> _MeanPatch:
    offsets = _WIDE * offsets_grid(_COUNT, samples_a_side=_COUNT).reshape(-1, 2)
    matrix = fit.filling.pattern.image_from_plane(fit.theta, size=evidence.image.size, focal_mm=fit.focal_mm)
    colours = evidence.colours_for(sample_px(matrix, where))
    at, front = project(colours.map_from_photo @ matrix, where.points(offsets))
    known = (front & sample_valid(colours.valid, at.float())).double()
    weight = known * (fit.contrast.clamp(min=0).double() + 1e-6)[:, None]
    lab = sample(colours.values, at.float()).double()
    # Objects may differ in brightness: each is compared with its own surroundings.
    rim = offsets.abs().amin(1) > 0.36 * _WIDE  # the corners
    ground = (lab * (known * rim)[..., None]).sum(1) / (known * rim).sum(1).clamp(min=1)[:, None]
    differs = (lab - ground[:, None]).norm(dim=-1)
    saliency = (differs * weight).sum(0) / weight.sum(0).clamp(min=1e-9)
    return _MeanPatch(offsets, (saliency - saliency[rim].mean()).clamp(min=0))


def _middle(patch: _MeanPatch) -> Tensor | None:
    """The middle of what stands out, [2] in sides; None where nothing clearly does."""
    if _lead(patch) < _STANDS_OUT:
        return None
    middle = torch.zeros(2, dtype=torch.float64)
    for _ in range(_STEPS):
        window = torch.exp(-(patch.offsets - middle).square().sum(1) / (2 * _WINDOW**2)) * patch.saliency
        middle = (window[:, None] * patch.offsets).sum(0) / window.sum().clamp(min=1e-9)
    return middle if float(middle.norm()) < _MOST else None


def _moved(fit: Fit, targets: Tensor) -> Tensor:
    """The numbers z [F] that draw closest to `targets` [N, 2] (program units) under the same camera."""
    filling, z = fit.filling, fit.z
    if all(unknown.name.startswith("camera.") for unknown in filling.moving):
        return z
    held = torch.tensor([unknown.name.startswith("camera.") for unknown in filling.moving])
    limits = moving_limits(filling, z).where(~held, 0.0)

    def points_of(numbers: Tensor) -> Tensor:
        return filling.pattern.points_at(fit.index, filling.theta(numbers))

    for _ in range(3):
        points, slopes = with_slopes(points_of, z, limits)
        rows = slopes.flatten(0, 1)
        # Numbers that hardly move the draws, alone or together, stay where they are.
        scale = rows.norm(dim=0).clamp(min=1e-9)
        step = torch.linalg.pinv(rows / scale, rtol=1e-3) @ (targets - points).flatten() / scale
        z = z + step * limits
    return z
