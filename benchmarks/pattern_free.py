"""Pictures without a pattern: how many `p3i.synth` refuses, and how much it thought of the others.

python benchmarks/pattern_free.py                    # 210 crops of photographs, then 100 at other scales
python benchmarks/pattern_free.py --crops 30 --scaled 20 --seed 1 --out crops.jsonl

Both sets are cut from photographs that scikit-image ships (the extra `bench`; nothing is downloaded), by
seed, so every run sees the same. The first are crops as they are. The second are of the photographs made
smaller or larger, some of them mirrored, and cut elsewhere; no search was tuned on them. No threshold is to
be set on either: wanted is that 97 % of each are refused. Of an answer the bits, the false alarms and the
score are printed.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import p3i
from p3i.search.config import SearchConfig
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

SIDES_PX = (176, 640)
MOST_SHARED = 0.5
"""Crops of one photo share at most this part of the area that they cover together."""

MOST_OF_ONE = 24
"""Crops that one photo gives at most, or the largest would give half of all."""

SHRUNK, ENLARGED = (0.3, 0.75), (1.35, 2.2)
"""What photographs of the second set are scaled by: far enough from 1 that its crops are not the first's."""


Box = tuple[int, int, int, int]
"""x, y, width and height of a crop, in pixels."""


@dataclass(frozen=True, slots=True)
class Source:
    """A photograph that crops are cut from: its file, its scale, whether it is mirrored."""

    file: str
    scale: float = 1.0
    mirrored: bool = False

    @property
    def title(self) -> str:
        """As it is printed."""
        scaled = "" if self.scale == 1 else f" x {self.scale:.2f}"
        return Path(self.file).stem + scaled + (" mirrored" if self.mirrored else "")

    def read(self) -> tuple[Image, int]:
        """The picture, and how many columns at its left hold a pattern, which no crop may show."""
        photo = p3i.read_image(folder() / self.file)
        left = FLAG_PX if self.file.startswith("astronaut") else 0
        if self.scale == 1 and not self.mirrored:
            return photo, left
        pixels = photo.pixels[:, left:]
        sides = (round(pixels.shape[1] * self.scale), round(pixels.shape[0] * self.scale))
        how = cv2.INTER_AREA if self.scale < 1 else cv2.INTER_CUBIC
        pixels = np.clip(cv2.resize(pixels, sides, interpolation=how), 0, 1)
        pixels = np.ascontiguousarray(pixels[:, ::-1] if self.mirrored else pixels, np.float32)
        return Image(pixels, np.ones(pixels.shape[:2], bool)), 0


def crops(count: int, seed: int = 0) -> Iterator[tuple[str, Image]]:
    """`count` crops with their names, in turn from every photo: place and sides (pixels) at random."""
    return _cut([Source(name) for name in PHOTOS], count, np.random.default_rng(seed))


def scaled_crops(count: int, seed: int = 0) -> Iterator[tuple[str, Image]]:
    """`count` crops of the photos made smaller and made larger, each by its own scale; some mirrored."""
    random = np.random.default_rng([seed, 1])
    sources = []
    for low, high in (SHRUNK, ENLARGED):
        for name in PHOTOS:
            scale = float(np.exp(random.uniform(np.log(low), np.log(high))))
            sources.append(Source(name, scale, bool(random.integers(2))))
    return _cut(sources, count, random)


def _cut(sources: Sequence[Source], count: int, random: np.random.Generator) -> Iterator[tuple[str, Image]]:
    """Crops of the sources in turn, but of those that have no room for another distinct one."""
    taken: dict[Source, list[Box]] = {source: [] for source in sources}
    full: set[Source] = set()
    number = made = 0
    while made < count and len(full) < len(sources):
        source = sources[number % len(sources)]
        number += 1
        if len(taken[source]) >= MOST_OF_ONE:
            full.add(source)
        if source in full:
            continue
        photo, left = source.read()
        box = _distinct_box(photo, taken[source], random, left=left)
        if box is None:
            full.add(source)
            continue
        taken[source].append(box)
        made += 1
        x, y, width, height = box
        cut = (slice(y, y + height), slice(x, x + width))
        image = Image(np.ascontiguousarray(photo.pixels[cut]), np.ascontiguousarray(photo.valid[cut]))
        yield f"{source.title} {width}x{height}+{x}+{y}", image


def _distinct_box(photo: Image, taken: list[Box], random: np.random.Generator, *, left: int) -> Box | None:
    """A new box beside those taken; None where 200 tries found no room."""
    rows, columns = photo.valid[:, left:].shape
    for _ in range(200):
        height, width = (int(random.integers(SIDES_PX[0], SIDES_PX[1] + 1)) for _ in range(2))
        height, width = min(height, rows), min(width, columns)
        y = int(random.integers(0, rows - height + 1))
        x = left + int(random.integers(0, columns - width + 1))
        if all(_shared((x, y, width, height), other) <= MOST_SHARED for other in taken):
            return x, y, width, height
    return None


def _shared(a: Box, b: Box) -> float:
    """The area that two boxes share, of what they cover together."""
    across = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    down = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    both = max(0, across) * max(0, down)
    return both / (a[2] * a[3] + b[2] * b[3] - both)


def folder() -> Path:
    """Where scikit-image keeps the pictures that it ships; ends the script where it is not there."""
    try:
        import skimage.data
    except ImportError:
        sys.exit("this benchmark needs scikit-image: pip install 'p3i[bench]'")
    return Path(skimage.data.__file__).parent


def searched(title: str, images: Iterator[tuple[str, Image]], out: Path | None) -> None:
    """Search each picture, tell of every answer, and in the end how many were refused, and the most bits."""
    bits: dict[str, float] = {}
    answered: list[str] = []
    for name, image in images:
        begun = time.process_time()
        result = p3i.synth(image, SearchConfig())
        bits[name] = result.bits if result.bits is not None else 0.0
        told: dict[str, Any] = {"set": title, "name": name, "answered": result.program is not None}
        told |= {"structure": result.structure, "score": result.score, "agreement": result.agreement}
        told |= {"bits": result.bits, "false_alarms": result.false_alarms}
        told["seconds"] = round(time.process_time() - begun, 2)
        if result.program is not None:
            answered.append(name)
            alarms = "" if result.false_alarms is None else f", {result.false_alarms:.1g} false alarms"
            objects = f"{result.structure} of {len(result.centers)}"
            print(f"{name}: {objects}, {bits[name]:.0f} bits{alarms}, score {result.score:.2f}", flush=True)
        if out is not None:
            with out.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(told) + "\n")
    if not bits:
        return
    refused = len(bits) - len(answered)
    print(f"{title}: {refused} of {len(bits)} refused ({refused / len(bits):.1%})")
    for what, some in (("answered", answered), ("refused", set(bits) - set(answered))):
        if some:
            most = max(some, key=bits.__getitem__)
            print(f"  most bits of those {what}: {bits[most]:.0f} ({most})")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--crops", type=int, default=210, help="crops as they are")
    parser.add_argument("--scaled", type=int, default=100, help="crops at other scales")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="a file for a line of JSON a picture; it is added to")
    given = parser.parse_args()
    searched("crops as they are", crops(given.crops, given.seed), given.out)
    searched("crops at other scales", scaled_crops(given.scaled, given.seed), given.out)


if __name__ == "__main__":
    main()
