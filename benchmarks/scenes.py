"""Rendered scenes with known truth: how often `p3i.synth` finds their camera, lattice and objects.

python benchmarks/scenes.py                        # the 60 scenes of seeds 0 to 59
python benchmarks/scenes.py --scenes 10 --features rgb
"""

import argparse
import math
import statistics
import time
from dataclasses import dataclass

import numpy as np
import torch

import p3i
from p3i.evaluation.scenes import Scene, lattice_scene
from p3i.grammar.ast import Affine
from p3i.interp.camera import Camera, project
from p3i.interp.unroll import nest
from p3i.search.config import SearchConfig
from p3i.search.result import SynthesisResult

HIT = 0.25
"""An object counts as found within this part of the spacing, on the true plane."""

WHOLE = 0.15
"""Lattice vectors agree when they are whole combinations of the true ones up to this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What came of one scene; without an answer the pose is 90 degrees off and nothing is found."""

    pose_deg: float = 90.0
    index: float | None = None
    """Area of the found cell in true cells: 1 is right, 2 is every second object."""
    same_lattice: bool = False
    f1: float = 0.0
    seconds: float


def compare(scene: Scene, result: SynthesisResult, seconds: float) -> Row:
    """Hold an answer to the truth of its scene."""
    if result.program is None:
        return Row(seconds=seconds)
    true, found = scene.camera, Camera.of(result.program)
    cosine = sum(a * b for a, b in zip(true.normal, found.normal, strict=True))
    pose_deg = math.degrees(math.acos(min(1.0, cosine)))
    basis, origin = _lattice(scene)
    centers = np.array(result.centers).reshape(-1, 4)
    if len(centers) < 3:
        return Row(pose_deg=pose_deg, seconds=seconds)
    cells = _true_cells(scene, centers[:, :2], basis, origin)
    # Where the found indices lie on the true lattice: cells = steps (i, j) + a constant.
    design = np.column_stack([centers[:, 2:], np.ones(len(centers))])
    steps = np.linalg.lstsq(design, cells, rcond=None)[0][:2]
    index = abs(float(np.linalg.det(steps)))
    same = bool(np.abs(steps - np.round(steps)).max() < WHOLE and abs(index - 1) < 0.2)
    truth = _true_cells(scene, scene.centers_px, basis, origin)
    f1 = _f1(cells @ basis, truth @ basis, HIT * float(np.linalg.norm(basis, axis=1).min()))
    return Row(pose_deg=pose_deg, index=index, same_lattice=same, f1=f1, seconds=seconds)


def _lattice(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """The true basis (rows u, v) and origin, in program units."""
    draw = nest(scene.program).draw
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    basis = np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]])
    return basis, np.array([draw.x.constant, draw.y.constant])


def _true_cells(scene: Scene, points_px: np.ndarray, basis: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Pixels [N, 2] as (i, j) of the true lattice, which need not be whole."""
    plane_from_image = torch.linalg.inv(scene.camera.image_from_plane(scene.size))
    plane, _ = project(plane_from_image, torch.from_numpy(np.asarray(points_px, dtype=np.float64)))
    return (plane.numpy() - origin) @ np.linalg.inv(basis)


def _f1(found: np.ndarray, true: np.ndarray, reach: float) -> float:
    """The harmonic mean of precision and recall; pairs within `reach` are made one to one, nearest first."""
    apart = np.linalg.norm(found[:, None] - true, axis=2)
    hits = 0
    while apart.size and apart.min() <= reach:
        row, column = np.unravel_index(apart.argmin(), apart.shape)
        apart[row, :] = apart[:, column] = np.inf
        hits += 1
    return 2 * hits / (len(found) + len(true))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=60, help="how many, from seed 0")
    parser.add_argument("--features", default="oriented", help="as of p3i synth")
    given = parser.parse_args()
    config, rows = SearchConfig(features=given.features), []
    for seed in range(given.scenes):
        scene = lattice_scene(seed)
        image, begun = scene.image(), time.process_time()
        result = p3i.synth(image, config)
        row = compare(scene, result, time.process_time() - begun)
        rows.append(row)
        index = "-" if row.index is None else f"{row.index:.2f}"
        said = f"score {result.score or 0:.3f}" + ("" if result.program else " refused")
        print(
            f"{seed:3} {scene.look:7} tilt {scene.camera.tilt_deg:2.0f}  objects {len(scene.index):3}"
            f"  pose {row.pose_deg:6.2f}  index {index:>5}  f1 {row.f1:.2f}  {said}  {row.seconds:.1f} s",
            flush=True,
        )
    poses = [row.pose_deg for row in rows]
    print(
        f"{len(rows)} scenes: right lattice {np.mean([row.same_lattice for row in rows]):.0%}, "
        f"pose below 1 degree {np.mean([pose < 1 for pose in poses]):.0%}, "
        f"median {statistics.median(poses):.2f}, "
        f"objects f1 {np.mean([row.f1 for row in rows]):.2f}, "
        f"answered {np.mean([row.index is not None for row in rows]):.0%}, "
        f"{np.mean([row.seconds for row in rows]):.1f} CPU s a scene"
    )


if __name__ == "__main__":
    main()
