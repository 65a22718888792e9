"""Whether the stated uncertainty of a tilt is true: the error of each pose against its `pose_sigma_deg`.

python benchmarks/pose_sigma.py                              # 10 scenes of each structure, seeds 100, ...
python benchmarks/pose_sigma.py --scenes 5 --first 300
python benchmarks/pose_sigma.py --set PHOTOS --results ANSWERS.jsonl     # lines of `p3i synth --format jsonl`

A line a picture: the error of the pose, what the answer says of it and, for scenes, the Cramer-Rao bound.
Then, of each structure and of all: the root mean square of error / sigma (1 where sigma is true), the share
of errors within one and within two sigma (0.39 and 0.86 where both components of the normal err alike), and
the rank correlation of errors with sigmas.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenes import apart_deg

import p3i
from p3i.evaluation.scenes import SCENES, scene
from p3i.interp.camera import Camera
from p3i.search.result import StructureFound


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One answer: the structure of the truth, the error and what was said of it, in degrees.

    `bound_deg` is the standard error where all objects are read as well as can be, None where nobody knows.
    """

    name: str
    structure: StructureFound
    error_deg: float
    sigma_deg: float
    bound_deg: float | None = None

    def __str__(self) -> str:
        said = f"{self.name:34} error {self.error_deg:6.2f}  sigma {self.sigma_deg:6.2f}"
        bound = "" if self.bound_deg is None else f"  bound {self.bound_deg:5.2f}"
        return f"{said}{bound}  ratio {self.error_deg / self.sigma_deg:5.2f}"


def of_scenes(count: int, first: int) -> Iterator[Row]:
    """Painted scenes, `count` of each structure, that are answered."""
    for seed in range(first, first + count):
        for structure in SCENES:
            drawn = scene(structure, seed)
            result = p3i.synth(drawn.image())
            if result.program is None or result.pose_sigma_deg is None:
                print(f"{structure} {seed} refused", flush=True)
                continue
            yield Row(
                name=f"{structure} {seed}",
                structure=structure,
                error_deg=apart_deg(drawn.camera, Camera.of(result.program)),
                sigma_deg=result.pose_sigma_deg,
                bound_deg=drawn.pose_sigma_deg,
            )


def of_photos(folder: Path, results: Path) -> Iterator[Row]:
    """The answers in `results` to the photos of an annotated set whose poses are reliable."""
    truths = {Path(one["file"]).name: one for one in json.loads((folder / "annotations.json").read_text())}
    for line in results.read_text().splitlines():
        answer = json.loads(line)
        truth = truths.get(Path(answer["image"]).name, {})
        sigma = None if answer["program"] is None else answer["camera"].get("pose_sigma_deg")
        if "pose" not in truth or not truth.get("pose_reliable", True) or sigma is None:
            continue
        true, found = truth["pose"], answer["camera"]
        yield Row(
            name=Path(answer["image"]).name,
            structure=answer["structure"],
            error_deg=apart_deg(
                Camera(true["rx"], true["ry"], true.get("focal_mm", 35.0)),
                Camera(found["rx"], found["ry"], found["focal"]),
            ),
            sigma_deg=sigma,
        )


def summary(name: str, rows: Sequence[Row]) -> str:
    """One line on many answers."""
    errors = np.array([row.error_deg for row in rows])
    sigmas = np.array([row.sigma_deg for row in rows])
    ratios = errors / sigmas
    ranks = np.corrcoef(errors.argsort().argsort(), sigmas.argsort().argsort())[0, 1]
    return (
        f"{name}: {len(rows)} answers, error / sigma rms {np.sqrt(np.mean(ratios**2)):.2f}, "
        f"median {np.median(ratios):.2f}, within 1 sigma {np.mean(ratios < 1):.0%}, "
        f"within 2 {np.mean(ratios < 2):.0%}, rank correlation {ranks:.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=10, help="how many of each structure")
    parser.add_argument("--first", type=int, default=100, metavar="SEED")
    parser.add_argument("--set", type=Path, metavar="FOLDER", help="an annotated set, with --results")
    parser.add_argument("--results", type=Path, metavar="JSONL", help="its answers")
    given = parser.parse_args()
    if (given.set is None) != (given.results is None):
        parser.error("--set and --results belong together")
    photos = None if given.set is None else of_photos(given.set, given.results)
    rows: list[Row] = []
    for row in photos or of_scenes(given.scenes, given.first):
        rows.append(row)
        print(row, flush=True)
    print()
    for structure in SCENES:
        own = [row for row in rows if row.structure == structure]
        if len(own) > 2:
            print(summary(structure, own))
    if len(rows) > 2:
        print(summary("all", rows))


if __name__ == "__main__":
    main()
