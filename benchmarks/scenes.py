"""Rendered scenes with known truth: how often `p3i.synth` finds their structure, camera and objects.

python benchmarks/scenes.py                          # 60 lattices, 40 rings, 30 hybrids, of seeds 0, 1, ...
python benchmarks/scenes.py --lattices 10 --rings 0 --hybrids 0 --features rgb
python benchmarks/scenes.py --structure forced       # the search is told which structure to look for

A line a scene; at its end what is wrong: refused, structure, lattice, pose (a degree or more, where it
counts: 4 x 4 objects seen, or 8 on a ring), objects (F1 below 0.8).
"""

import argparse
import statistics
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

import p3i
from p3i.evaluation.scenes import Scene, scene
from p3i.grammar.ast import Affine
from p3i.interp.camera import DEFAULT_FOCAL_MM, Camera, project
from p3i.interp.unroll import nest
from p3i.search.result import StructureFound, SynthesisResult

HIT = 0.25
"""An object counts as found within this part of the spacing, on the true plane."""

WHOLE = 0.15
"""Lattice vectors agree when they are whole combinations of the true ones up to this."""

POSE_DEG = 1.0
FIXED_DEG = 0.5
F1 = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What came of one scene; without an answer the pose is 90 degrees off and nothing is found."""

    structure: StructureFound
    counts: bool
    """Whether enough objects are seen for the pose to be asked for."""
    fixed: bool
    """Whether the objects' places fix the tilt to half a degree (standard error), read as well as can be."""
    found: StructureFound | None = None
    pose_deg: float = 90.0
    index: float | None = None
    """Area of the found cell in true cells: 1 is right, 2 is every second object. Lattices only."""
    same_lattice: bool = False
    f1: float = 0.0
    seconds: float

    def flags(self) -> str:
        """What is wrong, in words."""
        if self.found is None:
            return "refused"
        wrong = ["structure"] if self.found != self.structure else []
        if self.structure == self.found == "lattice" and not self.same_lattice:
            wrong.append("lattice")
        if self.counts and self.pose_deg >= POSE_DEG:
            wrong.append("pose")
        if self.f1 < F1:
            wrong.append("objects")
        return " ".join(wrong)


def compare(drawn: Scene, result: SynthesisResult, seconds: float) -> Row:
    """Hold an answer to the truth of its scene."""
    counts = many_enough(drawn)
    fixed = drawn.pose_sigma_deg is None or drawn.pose_sigma_deg <= FIXED_DEG
    if result.program is None:
        return Row(structure=drawn.structure, counts=counts, fixed=fixed, seconds=seconds)
    pose_deg = apart_deg(drawn.camera, Camera.of(result.program))
    centers = np.array(result.centers).reshape(-1, 4)
    index, same = _lattice_match(drawn, centers)
    truth, found = on_true_plane(drawn, drawn.centers_px), on_true_plane(drawn, centers[:, :2])
    apart = np.linalg.norm(truth[:, None] - truth, axis=2) + 1e9 * np.eye(len(truth))
    f1 = _f1(found, truth, HIT * float(np.median(apart.min(axis=1))))
    return Row(
        structure=drawn.structure,
        counts=counts,
        fixed=fixed,
        found=result.structure,
        pose_deg=pose_deg,
        index=index,
        same_lattice=same,
        f1=f1,
        seconds=seconds,
    )


def many_enough(drawn: Scene) -> bool:
    """Whether the picture shows at least 4 x 4 objects of a lattice, or 8 on a ring."""
    if drawn.structure == "lattice":
        return all(len(set(drawn.index[:, axis].tolist())) >= 4 for axis in (0, 1))
    return max(Counter(drawn.index[:, 0].tolist()).values()) >= 8


def apart_deg(true: Camera, found: Camera) -> float:
    """The angle between two planes, both told by their vanishing lines through a 35 mm lens."""
    first, second = (np.array(camera.refocused(DEFAULT_FOCAL_MM).normal) for camera in (true, found))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


def on_true_plane(drawn: Scene, places_px: np.ndarray) -> np.ndarray:
    """Pixels [N, 2] as points of the true plane, in program units."""
    plane_from_image = torch.linalg.inv(drawn.camera.image_from_plane(drawn.size))
    plane, _ = project(plane_from_image, torch.from_numpy(np.asarray(places_px, dtype=np.float64)))
    return plane.numpy()


def _lattice_match(drawn: Scene, centers: np.ndarray) -> tuple[float | None, bool]:
    """The area of the found cell in true cells, and whether the lattices are one."""
    draw = nest(drawn.program).draw
    if drawn.structure != "lattice" or len(centers) < 3:
        return None, False
    assert isinstance(draw.x, Affine) and isinstance(draw.y, Affine)
    basis = np.array([[draw.x.i, draw.y.i], [draw.x.j, draw.y.j]])
    origin = np.array([draw.x.constant, draw.y.constant])
    cells = (on_true_plane(drawn, centers[:, :2]) - origin) @ np.linalg.inv(basis)
    # Where the found indices lie on the true lattice: cells = steps (i, j) + a constant.
    design = np.column_stack([centers[:, 2:], np.ones(len(centers))])
    steps = np.linalg.lstsq(design, cells, rcond=None)[0][:2]
    index = abs(float(np.linalg.det(steps)))
    return index, bool(np.abs(steps - np.round(steps)).max() < WHOLE and abs(index - 1) < 0.2)


def _f1(found: np.ndarray, true: np.ndarray, reach: float) -> float:
    """The harmonic mean of precision and recall; pairs within `reach` are made one to one, nearest first."""
    apart = np.linalg.norm(found[:, None] - true, axis=2)
    hits = 0
    while apart.size and apart.min() <= reach:
        row, column = np.unravel_index(apart.argmin(), apart.shape)
        apart[row, :] = apart[:, column] = np.inf
        hits += 1
    return 2 * hits / (len(found) + len(true))


def summary(name: str, rows: Sequence[Row]) -> str:
    """One line on many scenes; poses are over those that show enough objects, the unanswered as 90."""
    poses = [row.pose_deg for row in rows if row.counts]
    right = np.mean([row.found == row.structure for row in rows])
    lattices = [row.same_lattice for row in rows if row.structure == "lattice"]
    posed = "no pose counts"
    if poses:
        share = np.mean([pose < POSE_DEG for pose in poses])
        posed = f"pose below 1 degree {share:.0%} of {len(poses)}, median {statistics.median(poses):.2f}"
        sure = [row.pose_deg < POSE_DEG for row in rows if row.counts and row.fixed]
        if sure:
            posed += f" ({np.mean(sure):.0%} of the {len(sure)} whose objects fix it)"
    return (
        f"{name}: {len(rows)} scenes, answered {np.mean([row.found is not None for row in rows]):.0%}, "
        f"right structure {right:.0%}, "
        + (f"right lattice {np.mean(lattices):.0%}, " if len(lattices) == len(rows) else "")
        + f"{posed}, objects f1 {np.mean([row.f1 for row in rows]):.2f}, "
        f"{np.mean([row.seconds for row in rows]):.1f} CPU s a scene"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--lattices", type=int, default=60, help="how many, from the first seed")
    parser.add_argument("--rings", type=int, default=40)
    parser.add_argument("--hybrids", type=int, default=30)
    parser.add_argument(
        "--first", type=int, default=0, metavar="SEED", help="the first seed of each structure"
    )
    parser.add_argument("--features", default="oriented", help="as of p3i synth")
    parser.add_argument("--structure", choices=["auto", "forced"], default="auto")
    parser.add_argument("--focals", action="store_true", help="a third of the rings through another lens")
    given = parser.parse_args()
    counts: dict[StructureFound, int] = {
        "lattice": given.lattices,
        "circular": given.rings,
        "hybrid": given.hybrids,
    }
    rows: list[Row] = []
    for structure, count in counts.items():
        changes = {"focals": given.focals} if structure == "circular" else {}
        for seed in range(given.first, given.first + count):
            drawn = scene(structure, seed, **changes)
            image, begun = drawn.image(), time.process_time()
            wanted: dict[str, Any] = {} if given.structure == "auto" else {"structure": structure}
            result = p3i.synth(image, features=given.features, **wanted)
            row = compare(drawn, result, time.process_time() - begun)
            rows.append(row)
            print(_line(drawn, result, row), flush=True)
    print()
    for structure in counts:
        own = [row for row in rows if row.structure == structure]
        if own:
            print(summary(structure, own))
    if rows:
        print(summary("all", rows))


def _line(drawn: Scene, result: SynthesisResult, row: Row) -> str:
    index = "" if row.index is None else f"  index {row.index:.2f}"
    return (
        f"{drawn.structure:8} {drawn.seed:3} {drawn.look:7} tilt {drawn.camera.tilt_deg:2.0f}  "
        f"objects {len(drawn.index):3}  {row.found or '-':8} pose {row.pose_deg:6.2f}{index}  "
        f"f1 {row.f1:.2f}  score {result.score or 0:.3f}  {row.seconds:.1f} s  {row.flags()}".rstrip()
    )


if __name__ == "__main__":
    main()
