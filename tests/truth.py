"""Scenes whose truth is known, as the search takes them, and how far an answer lies from that truth."""

import math
from functools import cache

import numpy as np
import torch

from p3i.evaluation.scenes import Scene, lattice_scene
from p3i.grammar.ast import Affine, Program
from p3i.interp.camera import Camera, rotation
from p3i.interp.unroll import nest
from p3i.search.config import SearchConfig
from p3i.search.forms.lattice import Lattice
from p3i.search.forms.spelled import lattice_filling
from p3i.search.look.evidence import Evidence, Level
from p3i.size import Size

torch.set_num_threads(1)

SMALL = Size(448, 336)
PATTERN = lattice_filling().pattern


@cache
def small_scene(seed: int, *, look: str | None = None, guards: float = 0.0) -> Scene:
    """A tilted lattice with a little jitter, clutter and noise, quick to search."""
    return lattice_scene(seed, size=SMALL, tilt_deg=(15, 50), jitter=0.2, clutter=2, look=look, guards=guards)


@cache
def evidence_of(scene: Scene) -> Evidence:
    return Evidence(scene.image(), SearchConfig(), scene.camera.focal_mm)


def lattice_of(program: Program) -> Lattice:
    """The camera and the lattice that a program of the search spells."""
    draw = nest(program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    basis = np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]])
    origin = np.array([draw.x.constant, draw.y.constant])
    return Lattice(program.camera.rx_deg, program.camera.ry_deg, basis, origin)


def true_theta(scene: Scene) -> torch.Tensor:
    """The numbers of the lattice sketch that draw the scene, (0, 0) in the middle of its objects."""
    middle = np.round(np.median(scene.index, axis=0))
    return lattice_of(scene.program).moved_to(middle).theta(PATTERN)


def index_in(scene: Scene) -> torch.Tensor:
    """The scene's objects [N, 2], counted as `true_theta` does."""
    return torch.from_numpy(scene.index - np.round(np.median(scene.index, axis=0))).double()


def turned(lattice: Lattice, *, rx_deg: float = 0.0, ry_deg: float = 0.0, scale: float = 1.0) -> Lattice:
    """The lattice with its camera turned and its basis scaled."""
    return Lattice(lattice.rx_deg + rx_deg, lattice.ry_deg + ry_deg, lattice.basis * scale, lattice.origin)


def pose_error_deg(found: Lattice | Program, truth: Lattice | Program) -> float:
    """The angle between the normals of two planes, in degrees."""
    first, second = (normal(one) for one in (found, truth))
    return math.degrees(math.acos(min(1.0, abs(float(first @ second)))))


def normal(of: Lattice | Program) -> np.ndarray:
    rx, ry = (of.rx_deg, of.ry_deg) if isinstance(of, Lattice) else (of.camera.rx_deg, of.camera.ry_deg)
    return np.asarray(rotation(rx, ry))[:, 2]


def lattice_error(found: np.ndarray, truth: np.ndarray) -> float:
    """How far the steps `found` [2, 2] are from being a basis of the lattice `truth` [2, 2], in steps.

    Infinite where they span another lattice: a multiple or a part of it.
    """
    ratio = found @ np.linalg.inv(truth)
    whole = np.round(ratio)
    if round(abs(np.linalg.det(whole))) != 1:
        return math.inf
    return float(np.abs(ratio - whole).max())


def blank_level(size: Size = SMALL, *, map_scale: float = 0.5, focal_mm: float = 35.0) -> Level:
    """A level without features, for what is geometry only: a map of `map_scale` of the photo."""
    width, height = round(size.width * map_scale), round(size.height * map_scale)
    shift = (map_scale - 1) / 2
    map_from_photo = torch.tensor(
        [[map_scale, 0, shift], [0, map_scale, shift], [0, 0, 1]], dtype=torch.float64
    )
    return Level(
        torch.zeros(3, height, width),
        torch.ones(height, width, dtype=torch.bool),
        map_from_photo,
        size,
        focal_mm,
    )


def camera_of(lattice: Lattice, focal_mm: float = 35.0) -> Camera:
    return Camera(lattice.rx_deg, lattice.ry_deg, focal_mm)
