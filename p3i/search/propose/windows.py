"""Where lattices may be: coarse guesses of camera and basis, to be refined.

Two kinds. *Straightened*: the whole picture is straightened under a grid of poses, and the autocorrelation
of each view scored; right for patterns that fill a good part of the frame. *Windows*: the picture's own
autocorrelation in overlapping windows, where perspective is mild; right for small patterns in clutter, and
for tilts beyond the grid. A window says nothing of the tilt, so it comes with several.
"""

import numpy as np

from p3i.interp.camera import image_from_plane
from p3i.search.forms.guess import Guess, lattice_guess
from p3i.search.forms.lattice import Lattice, reduce_basis
from p3i.search.look.evidence import FINE, Evidence, Level
from p3i.search.propose.poses import pose_grid
from p3i.search.propose.shifts import autocorrelation, best_pair
from p3i.search.propose.views import depth_of_view, even_weights, view_canvas, warped

# The canvas of a straightened view, in pixels a side.
_CANVAS = 128
# Poses lie about this far apart when seen straight on, closer with tilt, and up to this tilt.
POSE_STEP_DEG = 11.0
MOST_TILT_DEG = 66.0
# The autocorrelation sees this many channels (the strongest), which OpenCV warps in one go.
_CHANNELS = 4
# Shortest and longest shift, in pixels of the canvas.
_SHIFTS = (4.0, 60.0)
SIDE = 128
"""The side of a window, in pixels of the fine map."""
# Parts of a lattice may be shorter than what begins one, down to two pixels, the least that shows a valley.
_LEAST_PART = 2.0


def straightened_guesses(evidence: Evidence) -> list[Guess]:
    """One guess for each pose of the grid that shows a lattice, the most promising first."""
    level = evidence.frame
    view_of = _Views(level, evidence.focal_mm)
    found = []
    for rx_deg, ry_deg in pose_grid(POSE_STEP_DEG, MOST_TILT_DEG):
        view = view_of(rx_deg, ry_deg)
        if view is None:
            continue
        features, weights, unit, middle = view
        pair = best_pair(
            autocorrelation(features, weights), least=_SHIFTS[0], most=_SHIFTS[1], least_part=_LEAST_PART
        )
        if pair is not None:
            lattice = Lattice(rx_deg, ry_deg, reduce_basis(pair.basis * unit), middle)
            found.append(lattice_guess(lattice, pair.bits, local=False))
    return sorted(found, key=lambda guess: -guess.promise)


def window_guesses(evidence: Evidence, *, side: int = SIDE) -> list[Guess]:
    """A guess for each window that shows a lattice, seen straight on, the most promising first."""
    level = evidence.level(FINE, blur=0.5)
    planes = level.values[:_CHANNELS].permute(1, 2, 0).contiguous().numpy()
    known = level.valid.numpy().astype(np.float32)
    side = min(side, *known.shape)
    if side < 32:
        return []
    offset = np.arange(side) - (side - 1) / 2
    round_window = np.exp(-(offset[:, None] ** 2 + offset[None] ** 2) / (2 * (0.35 * side) ** 2))
    to_photo = np.linalg.inv(level.map_from_photo.numpy())
    found = []
    for top in _starts(known.shape[0], side):
        for left in _starts(known.shape[1], side):
            weights = known[top : top + side, left : left + side]
            if weights.mean() < 0.5:
                continue
            view = planes[top : top + side, left : left + side]
            pair = best_pair(
                autocorrelation(view, (weights * round_window).astype(np.float32)),
                least=5.0,
                most=0.5 * side,
                least_part=_LEAST_PART,
            )
            if pair is None:
                continue
            middle = to_photo @ np.array([left + (side - 1) / 2, top + (side - 1) / 2, 1.0])
            size = level.photo_size
            origin = (middle[:2] - np.array(size.middle)) / size.unit_px
            basis = pair.basis / level.unit_px
            lattice = Lattice(0.0, 0.0, reduce_basis(basis), origin)
            found.append(lattice_guess(lattice, pair.bits, local=True))
    return sorted(found, key=lambda guess: -guess.promise)


def _starts(length: int, side: int) -> list[int]:
    """Where windows of `side` start along `length`: half overlapping, the last at the edge."""
    return sorted({*range(0, length - side + 1, side // 2), length - side})


class _Views:
    """Straightened views of one map."""

    def __init__(self, level: Level, focal_mm: float) -> None:
        self._planes = level.values[:_CHANNELS].permute(1, 2, 0).contiguous().numpy()
        self._known = level.valid.numpy().astype(np.float32)
        self._level = level
        self._focal_mm = focal_mm

    def __call__(
        self, rx_deg: float, ry_deg: float
    ) -> tuple[np.ndarray, np.ndarray, float, np.ndarray] | None:
        """The view under a pose: features, weights, program units a pixel, and its middle on the plane."""
        level = self._level
        map_from_plane = (
            level.map_from_photo
            @ image_from_plane(rx_deg, ry_deg, size=level.photo_size, focal_mm=self._focal_mm)
        ).numpy()
        canvas = view_canvas(map_from_plane, level.size, side=_CANVAS)
        if canvas is None:
            return None
        map_from_view = map_from_plane @ canvas.plane_from_view

        depth = depth_of_view(map_from_view, _CANVAS)
        known = np.where(depth > 0, warped(self._known, map_from_view, _CANVAS), 0)
        if not (known > 0.5).any():
            return None
        features = warped(self._planes, map_from_view, _CANVAS)
        if features.ndim == 2:
            features = features[:, :, None]
        return features, even_weights(known, depth), canvas.unit, canvas.middle
