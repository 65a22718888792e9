"""Where rings may be: centres by votes of rotations, then radius and count by unrolling about them.

A ring looks the same when it is turned about its centre. For each pose of a grid the picture is
straightened and correlated with itself turned by some angles: a peak at the shift s speaks for the centre c
with s = (I - R) c. Rims, dials and wheels speak at every angle, a ring of n objects at about 360/n and its
multiples, all at one centre, and that point of the photo moves little with the pose. About each centre the
photo is unrolled, angle against the logarithm of the radius (look/unrolled.py), where a ring is a row.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.interp.camera import image_from_plane
from p3i.search.fit.best import Best
from p3i.search.fit.places import FOCALS_MM, numbers_of
from p3i.search.forms.guess import Guess
from p3i.search.forms.spelled import ring_filling
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.look.unrolled import Rows, best_rows, likeness, unroll
from p3i.search.propose.poses import pose_grid
from p3i.search.propose.spots import circles
from p3i.search.propose.views import even_weights, gradient_view
from p3i.search.propose.windows import MOST_TILT_DEG

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

# The canvas of a straightened view, in pixels a side, and of its padded transform.
_CANVAS = 96
_PADDED = 2 * _CANVAS
_POSE_STEP_DEG = 15.0
# Turns that between them come close to a multiple of 360/n for every n from 5 on.
_TURNS_DEG = (36.0, 45.0, 51.4, 60.0, 72.0)
# So many of the turns must agree: a ring of few objects answers to few.
_AGREEING = 2
# Peaks of the votes are this far apart, in canvas pixels.
_APART = 9
# An overlap of less than this share of the view's energy proves little.
_LEAST_OVERLAP = 0.4
# Centres closer than this share of the longer side are one.
_SAME_CENTRE = 0.03
_MOST_CENTRES = 16
_POSES_A_CENTRE = 3
# From so many centres the search climbs to the best pose and centre near by.
_MOST_CLIMBED = 8
# A circle of spots is worth as much as a centre with so many votes.
_SPOTS_WORTH = 0.15
# The first steps of the climb: degrees, and the centre's as a share of the radius; and how many rounds.
_STEP_DEG = 6.0
_STEP_SHARE = 0.08
_CLIMBS = 6
# Proposals are one where centre and radius differ by less than this share of the radius, and poses by less.
_SAME_SHARE = 0.04
_SAME_POSE_DEG = 3.0
# Proposals worth less than this share of the best are not told.
_LEAST_SHARE = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Vote:
    """A centre that rotations speak for: photo pixels, and the pose under which they do."""

    worth: float
    rx_deg: float
    ry_deg: float
    center_px: Array


def rotation_votes(evidence: Evidence) -> list[Vote]:
    """The centres that rotations speak for, at most a few for each pose, the most votes first."""
    part = evidence.part
    colours = evidence.colours_for(part.size.longer / (2.5 * _CANVAS))
    map_from_photo = colours.map_from_photo.numpy()
    found: list[Vote] = []
    for rx_deg, ry_deg in pose_grid(_POSE_STEP_DEG, MOST_TILT_DEG):
        seen = image_from_plane(rx_deg, ry_deg, size=evidence.image.size, focal_mm=evidence.focal_mm).numpy()
        view = gradient_view(colours, map_from_photo @ seen, side=_CANVAS)
        if view is None:
            continue
        votes = _votes(view.tensor, even_weights(view.known, view.depth))
        peaks = votes == cv2.dilate(votes, np.ones((_APART, _APART)))
        rows, columns = np.nonzero(peaks & (votes > 0))
        photo_from_view = np.linalg.inv(map_from_photo) @ view.map_from_view
        for place in range(len(rows)):
            at = photo_from_view @ [columns[place], rows[place], 1.0]
            center = at[:2] / at[2]
            if (np.abs(center - part.middle) < 0.53 * np.array([part.size.width, part.size.height])).all():
                worth = float(votes[rows[place], columns[place]])
                found.append(Vote(worth, rx_deg, ry_deg, center))
    return sorted(found, key=lambda vote: -vote.worth)


def ring_rounds(look: Session, best: Best) -> Iterator[list[Guess]]:
    """Rings as the focal that is assumed shows them, then, where nobody stated it, as a long one does.

    A closed ring says itself that its camera is right: under another one its steps do not make a whole turn.
    And where there is a ring, a lattice beyond noise is hardly ever found: of 28 photos and views of rings in
    none, and the best was worth -38 bits.
    """
    yield _ring_guesses(look, look.evidence)
    if look.focal_is_free and not best.holds_closed_ring() and not best.holds_lattice():
        # The one half way to the longest that is believed, as lenses go.
        long_mm = math.sqrt(look.evidence.focal_mm * FOCALS_MM[1])
        yield _ring_guesses(look, look.evidence.under(long_mm))


def _ring_guesses(look: Session, evidence: Evidence) -> list[Guess]:
    """Rings about the centres with the most votes and on circles of spots, the most promising first."""
    look.tell("turning", 0.82)
    centres: list[tuple[Vote, list[Rows]]] = []
    for votes in _by_centre(rotation_votes(evidence), evidence.part.size.longer):
        centres.append(max(((vote, _rows_about(evidence, vote)) for vote in votes), key=_promise))
    for camera, center_px in circles(evidence, np.random.default_rng(look.config.seed)):
        vote = Vote(_SPOTS_WORTH, camera.rx_deg, camera.ry_deg, center_px)
        centres.append((vote, _rows_about(evidence, vote)))
    found: list[Guess] = []
    for vote, rows in _apart(centres, evidence.part.size.longer)[:_MOST_CLIMBED]:
        vote = _climbed(evidence, vote, rows[0])
        found += [_guess(evidence, vote, row) for row in _rows_about(evidence, vote)]
    return _distinct(sorted(found, key=lambda guess: -guess.promise))


def _apart(centres: list[tuple[Vote, list[Rows]]], longer: int) -> list[tuple[Vote, list[Rows]]]:
    """Those about which there are rows, the most promising first, and of those close to each other one.

    Else most climbs would begin at one place: many votes and ellipses are of the same ring, or of one that
    only seems to be.
    """
    kept: list[tuple[Vote, list[Rows]]] = []
    for vote, rows in sorted(centres, key=_promise, reverse=True):
        near = (
            np.hypot(*(vote.center_px - other.center_px)) < _SAME_CENTRE * longer
            and math.hypot(vote.rx_deg - other.rx_deg, vote.ry_deg - other.ry_deg) < _POSE_STEP_DEG
            for other, _ in kept
        )
        if rows and not any(near):
            kept.append((vote, rows))
    return kept


def _guess(evidence: Evidence, vote: Vote, row: Rows) -> Guess:
    """A ring about the vote's centre, of as many objects as the row has."""
    x, y = _on_plane(evidence, vote).tolist()
    filling = ring_filling(row.count)
    values = {
        "camera.rx": vote.rx_deg,
        "camera.ry": vote.ry_deg,
        "draw.x.radius.1": row.radius,
        "draw.x.angle.1": 0.0,
        "draw.x.offset.1": x,
        "draw.y.offset.1": y,
    }
    promise = row.worth * math.sqrt(vote.worth)
    return Guess(filling, numbers_of(filling, values), promise, focal_mm=evidence.focal_mm)


def _distinct(guesses: list[Guess]) -> list[Guess]:
    """Without those that a better one says already, as climbs from several centres often end at the same, and
    without the hopeless; each with its promise as a share of the best one's.
    """
    kept: list[Guess] = []
    for one in guesses:
        if one.promise > _LEAST_SHARE * guesses[0].promise and not any(_same(one, other) for other in kept):
            kept.append(one)
    return [replace(one, promise=one.promise / guesses[0].promise) for one in kept]


def _same(one: Guess, other: Guess) -> bool:
    """Whether two guesses are so close that their fits end at the same ring."""
    if one.filling.sketch != other.filling.sketch:
        return False
    ours, theirs = (guess.filling.named(guess.z) for guess in (one, other))

    def apart(*names: str) -> float:
        return math.hypot(*(ours[name] - theirs[name] for name in names))

    near = _SAME_SHARE * theirs["draw.x.radius.1"]
    return (
        apart("draw.x.offset.1", "draw.y.offset.1") < near
        and apart("draw.x.radius.1") < near
        and apart("camera.rx", "camera.ry") < _SAME_POSE_DEG
    )


def _promise(centre: tuple[Vote, list[Rows]]) -> float:
    vote, rows = centre
    return rows[0].worth * math.sqrt(vote.worth) if rows else 0.0


def _climbed(evidence: Evidence, vote: Vote, row: Rows) -> Vote:
    """The pose and centre near the vote's under which the ring agrees best: one number after the other."""
    numbers = np.array([vote.rx_deg, vote.ry_deg, *vote.center_px])
    radius_px = row.radius * evidence.image.size.unit_px
    steps = np.array([_STEP_DEG, _STEP_DEG, _STEP_SHARE * radius_px, _STEP_SHARE * radius_px])

    def at(numbers: Array) -> Vote:
        return replace(vote, rx_deg=float(numbers[0]), ry_deg=float(numbers[1]), center_px=numbers[2:])

    def worth(numbers: Array) -> float:
        moved = at(numbers)
        pose, center = (moved.rx_deg, moved.ry_deg), _on_plane(evidence, moved)
        strip = unroll(evidence, pose, center, focal_mm=evidence.focal_mm, about=row.radius)
        return 0.0 if strip is None else likeness(strip, row.count)

    best = worth(numbers)
    for _ in range(_CLIMBS):
        for place in range(len(numbers)):
            for sign in (1.0, -1.0):
                moved = numbers.copy()
                moved[place] += sign * steps[place]
                value = worth(moved)
                if value > best:
                    numbers, best = moved, value
                    break
            else:
                steps[place] *= 0.5
    return at(numbers)


def _rows_about(evidence: Evidence, vote: Vote) -> list[Rows]:
    center = _on_plane(evidence, vote)
    strip = unroll(evidence, (vote.rx_deg, vote.ry_deg), center, focal_mm=evidence.focal_mm)
    return [] if strip is None else best_rows(strip)


def _on_plane(evidence: Evidence, vote: Vote) -> Array:
    """The vote's centre in program units under its pose."""
    matrix = image_from_plane(
        vote.rx_deg, vote.ry_deg, size=evidence.image.size, focal_mm=evidence.focal_mm
    ).numpy()
    at = np.linalg.inv(matrix) @ [*vote.center_px, 1.0]
    return at[:2] / at[2]


def _by_centre(votes: list[Vote], longer: int) -> list[list[Vote]]:
    """The votes for each of the best centres, each under its best few poses."""
    groups: list[list[Vote]] = []
    for vote in votes:
        for group in groups:
            if np.hypot(*(group[0].center_px - vote.center_px)) < _SAME_CENTRE * longer:
                if len(group) < _POSES_A_CENTRE:
                    group.append(vote)
                break
        else:
            if len(groups) < _MOST_CENTRES:
                groups.append([vote])
    return groups


def _votes(tensor: NDArray, weights: Floats) -> Floats:
    """How much rotations speak for each pixel of the view as a centre: [_CANVAS, _CANVAS]."""
    middle = (_CANVAS - 1) / 2
    energy = np.abs(tensor) ** 2
    turned_by: list[Floats] = []
    first = _transform(tensor * weights)
    rest = _transform(weights * energy - 1j * weights)
    rows, columns = np.mgrid[0:_CANVAS, 0:_CANVAS] - middle
    for turn_deg in _TURNS_DEG:
        turn = math.radians(turn_deg)
        rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
        about_middle = np.hstack([rotation, (middle - rotation @ [middle, middle])[:, None]])

        def turned(plane: NDArray, matrix: Array = about_middle) -> NDArray:
            return cv2.warpAffine(np.ascontiguousarray(plane, np.float32), matrix, (_CANVAS, _CANVAS))

        weight = turned(weights)
        other = (turned(np.real(tensor)) + 1j * turned(np.imag(tensor))) * np.exp(2j * turn)
        alike = _correlation(first, _transform(other * weight))[..., 0]
        # The imaginary part is sum w E w' + w E' w': the energy of both where they overlap.
        both = _correlation(rest, _transform(weight * np.abs(other) ** 2 + 1j * weight))[..., 1]
        ncc = 2 * alike / np.maximum(both, _LEAST_OVERLAP * both.max())
        # What is turned about c lies shifted by (I - R) c from what is turned about the middle.
        shift_x = -((1 - rotation[0, 0]) * columns - rotation[0, 1] * rows)
        shift_y = -(-rotation[1, 0] * columns + (1 - rotation[1, 1]) * rows)
        at = [(shift + _PADDED / 2).astype(np.float32) for shift in (shift_x, shift_y)]
        centred = np.fft.fftshift(ncc).astype(np.float32)
        turned_by.append(np.asarray(cv2.remap(centred, at[0], at[1], cv2.INTER_LINEAR), np.float32))
    votes = np.sort(np.stack(turned_by), 0)[-_AGREEING:].mean(0)
    votes = votes - cv2.GaussianBlur(votes, (0, 0), 0.06 * _CANVAS)
    return cv2.GaussianBlur(votes, (0, 0), 1.0)  # pyright: ignore[reportReturnType]


def _transform(plane: NDArray) -> Floats:
    padded = np.zeros((_PADDED, _PADDED, 2), np.float32)
    padded[:_CANVAS, :_CANVAS, 0], padded[:_CANVAS, :_CANVAS, 1] = np.real(plane), np.imag(plane)
    return cv2.dft(padded, flags=cv2.DFT_COMPLEX_OUTPUT)  # pyright: ignore


def _correlation(first: Floats, second: Floats) -> Floats:
    """sum over x of conj(a(x)) b(x + s), [_PADDED, _PADDED, 2] by the shift s, from the transforms."""
    product = cv2.mulSpectrums(second, first, 0, conjB=True)
    return cv2.idft(product, flags=cv2.DFT_SCALE | cv2.DFT_COMPLEX_OUTPUT)  # pyright: ignore
