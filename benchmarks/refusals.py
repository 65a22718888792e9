"""Scores of photos without a pattern: how many `p3i.synth` refuses, and which score separates them.

python benchmarks/refusals.py                     # 210 crops of the photos that scikit-image ships
python benchmarks/refusals.py --crops 30 PHOTOS   # fewer crops; then photos with a pattern, for comparison

The crops are drawn from a seed, so every run sees the same. It needs scikit-image (the extra `bench`),
but downloads nothing.
"""

import argparse
import sys
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

import p3i
from p3i.errors import P3IError
from p3i.search.config import SearchConfig
from p3i.search.result import NEEDED
from p3i.vision.image import Image

PHOTOS = (
    "astronaut.png",
    "camera.png",
    "cell.png",
    "chelsea.png",
    "clock_motion.png",
    "coffee.png",
    "grass.png",
    "gravel.png",
    "horse.png",
    "hubble_deep_field.jpg",
    "ihc.png",
    "moon.png",
    "motorcycle_left.png",
    "motorcycle_right.png",
    "retina.jpg",
    "rocket.jpg",
)
"""Pictures of scikit-image without a repeating plane. Left out: coins, bricks, boards, lines of text,
drawings, and what is smaller than the smallest crop."""

FLAG_PX = 110
"""The left part of the astronaut's photo holds a flag, whose stars and stripes are a pattern."""

SIDES_PX = (256, 640)
THRESHOLDS = (0.05, 0.08, 0.1, 0.12, 0.15, 0.18, 0.2, 0.25, 0.3, 0.35)


def crops(count: int, seed: int) -> Iterator[tuple[str, Image]]:
    """`count` crops with their names, in turn from every photo: place and sides (pixels) at random."""
    try:
        import skimage.data
    except ImportError:
        sys.exit("this benchmark needs scikit-image: pip install 'p3i[bench]'")
    folder = Path(skimage.data.__file__).parent
    random = np.random.default_rng(seed)
    for number in range(count):
        name = PHOTOS[number % len(PHOTOS)]
        photo = p3i.read_image(folder / name)
        left = FLAG_PX if name.startswith("astronaut") else 0
        rows, columns = photo.valid[:, left:].shape
        height, width = (int(random.integers(SIDES_PX[0], SIDES_PX[1] + 1)) for _ in range(2))
        height, width = min(height, rows), min(width, columns)
        y = int(random.integers(0, rows - height + 1))
        x = left + int(random.integers(0, columns - width + 1))
        cut = (slice(y, y + height), slice(x, x + width))
        image = Image(np.ascontiguousarray(photo.pixels[cut]), np.ascontiguousarray(photo.valid[cut]))
        yield f"{Path(name).stem} {width}x{height}+{x}+{y}", image


def photos(folder: Path) -> Iterator[tuple[str, Image]]:
    """The photos of a folder that can be read, with their names."""
    for path in sorted(folder.iterdir()):
        try:
            yield path.name, p3i.read_image(path)
        except P3IError as error:
            print(f"{path.name}: {error}", file=sys.stderr)


def measure(images: Iterable[tuple[str, Image]], config: SearchConfig) -> list[float]:
    """The best score seen on each image, 0 where the search proposed nothing; a line for each.

    An image on which the search breaks off is a bug: it is named and left out.
    """
    scores: list[float] = []
    for name, image in images:
        begun = time.process_time()
        try:
            result = p3i.synth(image, config)
        except Exception as bug:
            print(f"{name:40} BUG {type(bug).__name__}: {bug}", flush=True)
            traceback.print_exc()
            continue
        seconds = time.process_time() - begun
        scores.append(result.score or 0.0)
        said = "answered" if result.program is not None else result.stop.name.lower()
        print(f"{name:40} {scores[-1]:.3f} {said:16} {seconds:.1f} s", flush=True)
    return scores


def summary(title: str, scores: Sequence[float]) -> None:
    """Print how the scores are distributed, and the share that reaches each threshold."""
    refused = sum(score < NEEDED for score in scores)
    print(f"\n{title}: {len(scores)}, of which {refused} refused (a score below {NEEDED})")
    places = (100, 99, 95, 90, 50, 10, 5, 1, 0)
    values = np.percentile(scores, places)
    print(
        "percentile "
        + "  ".join(f"{place}: {value:.3f}" for place, value in zip(places, values, strict=True))
    )
    shares = (f"{limit}: {np.mean(np.array(scores) >= limit):.1%}" for limit in THRESHOLDS)
    print("reaching   " + "  ".join(shares) + "\n", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", nargs="?", type=Path, help="photos with a pattern, for comparison")
    parser.add_argument("--crops", type=int, default=210, help="how many crops without a pattern")
    parser.add_argument("--seed", type=int, default=0, help="the seed of the crops")
    parser.add_argument("--features", default="oriented", help="as of p3i synth")
    given = parser.parse_args()
    config = SearchConfig(features=given.features)
    if given.crops > 0:
        summary("crops without a pattern", measure(crops(given.crops, given.seed), config))
    if given.folder is not None:
        summary("photos with a pattern", measure(photos(given.folder), config))


if __name__ == "__main__":
    main()
