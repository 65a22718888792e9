"""Agreement on pictures without a pattern and with one: what `p3i.synth` refuses, rightly and wrongly.

python benchmarks/refusals.py                          # 210 crops without a pattern, 100 pictures with one
python benchmarks/refusals.py --crops 30 --scenes 0 PHOTOS   # fewer crops; then photos with a pattern
python benchmarks/refusals.py --out scores.json        # every agreement, by kind of pattern

Every family of the search (lattices, rings, ...) looks at every picture, and the best agreement that each
reaches is kept, and the most bits. A picture counts as answered where `p3i.synth` would answer it: by the
agreement and more bits than the program costs, or by the number of false alarms (docs/search.md). The crops
are drawn from a seed (benchmarks/pattern_free.py), so every run sees the same. It needs scikit-image (the
extra `bench`), but downloads nothing.
"""

import argparse
import dataclasses
import json
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import robustness
from pattern_free import crops, folder

import p3i
from p3i.errors import P3IError
from p3i.interp.camera import Camera
from p3i.search.answer import Answer
from p3i.search.config import SearchConfig
from p3i.search.judge.accept import beyond_noise
from p3i.search.look.evidence import Evidence
from p3i.search.look.session import Session
from p3i.search.outcome import focal_of
from p3i.search.result import NEEDED, STRUCTURES
from p3i.search.synthesize import searched
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.threads import limit_threads

THRESHOLDS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.18, 0.2, 0.25, 0.3, 0.35)

MILD = (
    ("none", "-"),
    ("blur", "1.5 px"),
    ("jpeg", "quality 30"),
    ("noise", "0.05"),
    ("light", "1:3"),
    ("occlusion", "20%"),
    ("missing", "15%"),
    ("looks", "jitter 0.7"),
    ("area", "20% of the frame"),
    ("tilt", "60-65 degrees"),
)
"""Harms of benchmarks/robustness.py, and levels, that a photo with a pattern may well have."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scores:
    """The best score of each family on one picture, 0 where it proposed nothing, and the most bits."""

    name: str
    pattern: bool
    best: dict[str, float] = field(default_factory=dict)
    bits: dict[str, float | None] = field(default_factory=dict)
    answered: bool = False
    seconds: float = 0.0

    @property
    def highest(self) -> float:
        """The best score of all families."""
        return max(self.best.values(), default=0.0)


def scenes(count: int) -> Iterator[tuple[str, Image]]:
    """`count` rendered lattices, mildly spoilt in turn; seeds that benchmarks/robustness.py does not use."""
    harms = robustness.harms()
    for number in range(count):
        harm, level = MILD[number % len(MILD)]
        scene = harms[harm][level](100 + number // len(MILD))
        yield f"scene {scene.seed} {harm} {level}", scene.image()


def boards() -> Iterator[tuple[str, Image]]:
    """The board that scikit-image ships, seen under eight cameras. (Its bricks lie in no lattice.)"""
    size, plane = Size(640, 480), p3i.read_image(folder() / "chessboard_GRAY.png").pixels
    units = 130 / max(plane.shape[:2])  # of the plane, for a pixel of the board
    middle = np.array([plane.shape[1] - 1, plane.shape[0] - 1]) / 2
    plane_from_board = np.array([[units, 0, -units * middle[0]], [0, units, -units * middle[1]], [0, 0, 1.0]])
    for number in range(8):
        camera = Camera.from_normal((0.7 * np.cos(0.8 * number), 0.7 * np.sin(0.8 * number), 1.0))
        matrix = camera.image_from_plane(size).numpy() @ plane_from_board
        pixels = cv2.warpPerspective(
            plane, matrix, (size.width, size.height), flags=cv2.INTER_LINEAR, borderValue=(0.5, 0.5, 0.5)
        )
        pixels = np.clip(np.asarray(pixels, np.float32), 0, 1)
        yield f"board, camera {number}", Image(pixels, np.ones(pixels.shape[:2], bool))


def photos(folder: Path) -> Iterator[tuple[str, Image]]:
    """The photos of a folder that can be read, with their names."""
    for path in sorted(folder.iterdir()):
        try:
            yield path.name, p3i.read_image(path)
        except P3IError as error:
            print(f"{path.name}: {error}", file=sys.stderr)


def measure(images: Iterable[tuple[str, Image]], config: SearchConfig, *, pattern: bool) -> list[Scores]:
    """The best score of each family on each image; a line for each.

    An image on which the search breaks off is a bug: it is named and left out.
    """
    found: list[Scores] = []
    limit_threads(config.threads)
    for name, image in images:
        begun = time.process_time()
        try:
            evidence = Evidence(image, config, focal_of(image, config)[0])
            wanted = STRUCTURES if config.structure == "auto" else (config.structure,)
            alone = {one: dataclasses.replace(config, structure=one) for one in wanted}
            answers = {one: list(searched(Session(evidence, alone[one])).asked()) for one in wanted}
            explained = [answer for some in answers.values() for answer in some]
        except Exception as bug:
            print(f"{name:40} BUG {type(bug).__name__}: {bug}", flush=True)
            traceback.print_exc()
            continue
        seconds = round(time.process_time() - begun, 2)
        best = {structure: _best(some) for structure, some in answers.items()}
        answered = any(beyond_noise(answer.worth) for answer in explained)
        bits = {one: _most_bits(explained, one) for one in answers}
        scores = Scores(name=name, pattern=pattern, best=best, bits=bits, answered=answered, seconds=seconds)
        found.append(scores)
        _print_line(scores)
    return found


def _most_bits(explained: Sequence[Answer], structure: str) -> float | None:
    """The most bits that an answer of a structure explains, None where there is none."""
    bits = [round(answer.worth, 1) for answer in explained if answer.structure == structure]
    return max(bits, default=None)


def _print_line(scores: Scores) -> None:
    """A picture's scores and bits, family by family, and what became of it."""
    families = []
    for structure, score in scores.best.items():
        bits = scores.bits[structure]
        families.append(f"{structure} {score:.3f}" + ("" if bits is None else f" {bits:.0f} bits"))
    said = "answered" if scores.answered else "refused"
    print(f"{scores.name:40} {'  '.join(families)}  {said:8} {scores.seconds:.1f} s", flush=True)


def _best(answers: Sequence[Answer]) -> float:
    return round(max((answer.score for answer in answers), default=0.0), 4)


def summary(title: str, found: Sequence[Scores]) -> None:
    """Print how the scores are distributed, of each family and of the best of them."""
    if not found:
        return
    refused = sum(not scores.answered for scores in found)
    low = sum(scores.highest < NEEDED for scores in found)
    print(f"\n{title}: {len(found)}, of which {refused} refused ({low} by a score below {NEEDED})")
    columns = {structure: [scores.best[structure] for scores in found] for structure in found[0].best}
    if len(columns) > 1:
        columns["best"] = [scores.highest for scores in found]
    places = (100, 99, 98, 95, 90, 50, 10, 5, 3, 1, 0)
    for name, values in columns.items():
        told = zip(places, np.percentile(values, places), strict=True)
        print(f"{name:9} percentile " + "  ".join(f"{place}: {value:.3f}" for place, value in told))
        shares = (f"{limit}: {np.mean(np.array(values) >= limit):.1%}" for limit in THRESHOLDS)
        print(f"{name:9} reaching   " + "  ".join(shares))
    print(flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, help="photos with a pattern, for comparison")
    parser.add_argument("--crops", type=int, default=210, help="how many crops without a pattern")
    parser.add_argument("--scenes", type=int, default=84, help="how many rendered lattices, mildly spoilt")
    parser.add_argument(
        "--boards", action=argparse.BooleanOptionalAction, default=True, help="eight views of a board"
    )
    parser.add_argument("--seed", type=int, default=0, help="the seed of the crops")
    parser.add_argument("--features", default="oriented", help="as of p3i synth")
    parser.add_argument("--structure", default="auto", help="as of p3i synth")
    parser.add_argument("--out", type=Path, help="a JSON file for every score")
    given = parser.parse_args()
    config = SearchConfig(features=given.features, structure=given.structure)
    found: list[Scores] = []
    sets: list[tuple[str, bool, Iterable[tuple[str, Image]]]] = [
        ("crops without a pattern", False, crops(given.crops, given.seed)),
        ("rendered lattices", True, scenes(given.scenes)),
        ("a board", True, boards() if given.boards else ()),
        ("photos with a pattern", True, photos(given.folder) if given.folder is not None else ()),
    ]
    for title, pattern, images in sets:
        measured = measure(images, config, pattern=pattern)
        summary(title, measured)
        found += measured
        if given.out is not None:
            given.out.write_text(json.dumps([dataclasses.asdict(scores) for scores in found], indent=1))


if __name__ == "__main__":
    main()
