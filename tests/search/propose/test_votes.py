"""Proposals of rings: rotations vote for the centre, and climbing brings pose and centre close."""

import cv2
import numpy as np
import pytest
from drawn import DrawnRing

from p3i.interp.camera import rotation
from p3i.search.config import SearchConfig
from p3i.search.fit.best import Best
from p3i.search.forms.guess import Guess
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.look.unrolled import Rows
from p3i.search.propose import votes as ring
from p3i.search.propose.poses import pose_grid
from p3i.search.propose.views import gradient_tensor
from p3i.search.propose.votes import Vote, _apart, ring_rounds, rotation_votes

RING = DrawnRing()


@pytest.fixture(scope="module")
def votes() -> list[Vote]:
    return rotation_votes(RING.evidence())


@pytest.fixture(scope="module")
def guesses(votes: list[Vote]) -> list[Guess]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ring, "rotation_votes", lambda evidence: votes)  # cast once
        return next(ring_rounds(Session(RING.evidence(), SearchConfig()), Best()))


def test_rotations_vote_for_the_centre_of_a_tilted_ring(votes: list[Vote]) -> None:
    center = RING.seen(np.array([RING.center]))[0]
    assert np.linalg.norm(votes[0].center_px - center) < 0.03 * RING.canvas.longer
    assert [vote.worth for vote in votes] == sorted((vote.worth for vote in votes), reverse=True)
    elsewhere = [v for v in votes if np.linalg.norm(v.center_px - center) > 0.15 * RING.canvas.longer]
    assert votes[0].worth > 1.3 * elsewhere[0].worth


def test_the_best_guess_is_the_ring(guesses: list[Guess]) -> None:
    best = guesses[0]
    assert len(best.filling.pattern.index) == RING.count
    found = best.filling.named(best.z)
    assert abs(found["camera.rx"] - RING.rx_deg) < 3 and abs(found["camera.ry"] - RING.ry_deg) < 3
    center = np.array([found["draw.x.offset.1"], found["draw.y.offset.1"]])
    assert np.linalg.norm(center - RING.center) < 1
    assert found["draw.x.radius.1"] == pytest.approx(RING.radius, rel=0.1)


def test_guesses_come_best_first(guesses: list[Guess]) -> None:
    assert guesses[0].promise == 1
    assert [one.promise for one in guesses] == sorted((one.promise for one in guesses), reverse=True)


def test_no_guess_says_what_a_better_one_said_and_none_is_hopeless(guesses: list[Guess]) -> None:
    """Climbs from several centres end at this ring, and each would tell of it and of its neighbours."""
    assert all(one.promise > 0.02 for one in guesses)
    told = [(len(one.filling.pattern.index), one.filling.named(one.z)) for one in guesses]
    most = {"draw.x.offset.1": 1, "draw.y.offset.1": 1, "draw.x.radius.1": 1, "camera.rx": 2, "camera.ry": 2}
    for place, (count, one) in enumerate(told):
        for other_count, other in told[:place]:
            apart = any(abs(one[name] - other[name]) > limit for name, limit in most.items())
            assert count != other_count or apart


def test_a_double_angle_turns_twice_as_fast_as_an_edge() -> None:
    """Black beside white: the gradient points along the ramp, and a half turn of it is no turn."""
    rows, columns = np.mgrid[0:40, 0:40].astype(np.float32)
    for turn_deg in (0, 30, 90, 135, 210):
        turn = np.radians(turn_deg)
        ramp = (columns * np.cos(turn) + rows * np.sin(turn)).astype(np.float32)
        angle = np.angle(gradient_tensor(cv2.merge([ramp, 0 * ramp, 0 * ramp]))[20, 20])
        assert np.cos(angle - 2 * turn) == pytest.approx(1, abs=1e-4)


def test_the_poses_reach_the_tilt_and_leave_no_gap() -> None:
    normals = np.array([np.asarray(_normal(*pose)) for pose in pose_grid(15.0, 62.0)])
    tilts = np.degrees(np.arccos(normals[:, 2].clip(-1, 1)))
    assert tilts.max() < 62.01
    random = np.random.default_rng(0)
    for _ in range(100):
        tilt, around = np.radians(random.uniform(0, 55)), random.uniform(0, 2 * np.pi)
        wanted = np.array([np.sin(tilt) * np.cos(around), np.sin(tilt) * np.sin(around), np.cos(tilt)])
        assert np.degrees(np.arccos((normals @ wanted).max().clip(-1, 1))) < 15


def _normal(rx_deg: float, ry_deg: float) -> np.ndarray:
    return np.asarray(rotation(rx_deg, ry_deg))[:, 2]


@pytest.mark.parametrize(
    ("stated", "found", "focals"),
    [(None, "", 2), (50.0, "", 1), (None, "holds_closed_ring", 1), (None, "holds_lattice", 1)],
    ids=["free", "stated", "closed", "lattice"],
)
def test_a_long_focal_is_tried_where_nobody_stated_one_and_neither_closed_ring_nor_lattice_was_found(
    stated: float | None, found: str, focals: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("holds_closed_ring", "holds_lattice"):
        monkeypatch.setattr(Best, name, lambda _, holds=name == found: holds)
    config = SearchConfig(focal_mm=stated)
    look = Session(Evidence(DrawnRing().image(), config, stated or 35.0), config)
    told = [{guess.focal_mm for guess in guesses} for guesses in ring_rounds(look, Best())]
    assert len(told) == focals
    assert told[0] == {stated or 35.0}
    assert all(mm is not None and mm > 80 for later in told[1:] for mm in later)


def test_climbs_begin_apart_and_where_there_are_rows() -> None:
    def centre(x: float, rx_deg: float, worth: float, *, rows: bool = True) -> tuple[Vote, list[Rows]]:
        vote = Vote(worth, rx_deg, 0.0, np.array([x, 200.0]))
        return vote, [Rows(8, 20.0, 0.5)] if rows else []

    best, beside, turned = centre(300, 0, 0.4), centre(310, 5, 0.3), centre(305, 40, 0.2)
    far, empty = centre(600, 0, 0.1), centre(500, 0, 0.9, rows=False)
    kept = _apart([far, beside, empty, turned, best], longer=1000)
    assert [vote for vote, _ in kept] == [vote for vote, _ in (best, turned, far)]
