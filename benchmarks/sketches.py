"""Sketches by hand on rendered scenes: how often the holes are filled as the scene was drawn.

python benchmarks/sketches.py                     # 4 scenes of each kind, holes with bounds
python benchmarks/sketches.py --scenes 8 --open   # holes without bounds
"""

import argparse
import math
import random
import statistics
import time
from dataclasses import dataclass

import numpy as np

import p3i
from p3i.evaluation.program_scenes import program_scene, spacing_px
from p3i.evaluation.scene import Scene
from p3i.grammar.sketch import Sketch, parse_sketch
from p3i.interp.camera import Camera

LOOKS = ("disc", "flower", "letter", "window")
HIT = 0.2
"""An object counts as found within this part of the spacing in the picture."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of pattern that no family knows: its program, and sketches of it with and without bounds."""

    program: str
    bounded: str
    free: str


def _sketch(x: str, y: str, loops: str) -> str:
    return f"SetCameraPose(rx=??, ry=??)\n{loops}Draw(x={x}, y={y})\n"


_J = "for j in range(0, {n}):\n    "
_IJ = "for i in range(0, 2):\n    for j in range(0, {n}):\n        "
KINDS = {
    "spiral": Kind(
        "({a}*j + {b})*Cos({c}*j + {p}) + {x}|({a}*j + {b})*Sin({c}*j + {p}) + {y}",
        "(?a(0.5, 2)*j + ?b(6, 18))*Cos(?c(20, 45)*j + ?p(0, 360)) + ??(-10, 10)"
        "|(?a*j + ?b)*Sin(?c*j + ?p) + ??(-10, 10)",
        "(?a*j + ?b)*Cos(?c*j + ?p) + ??|(?a*j + ?b)*Sin(?c*j + ?p) + ??",
    ),
    "arc": Kind(
        "{r}*Cos({s}*j + {q}) + {x}|{r}*Sin({s}*j + {q}) + {y}",
        "?r(20, 45)*Cos(?s(10, 30)*j + ?p(130, 260)) + ??(-10, 10)|?r*Sin(?s*j + ?p) + ??(-10, 10)",
        "?r*Cos(?s*j + ?p) + ??|?r*Sin(?s*j + ?p) + ??",
    ),
    "staggered row": Kind(
        "{k}*i + {u}*j - 34|{v}*i + {w}*j - 10",
        "??(0, 10)*i + ??(6, 15)*j + ??(-40, -25)|??(6, 16)*i + ??(-4, 4)*j + ??(-20, 0)",
        "??*i + ??*j + ??|??*i + ??*j + ??",
    ),
}


def scene_of(name: str, seed: int) -> tuple[Scene, dict[str, Sketch]]:
    """A scene of the kind `name`, and its sketches: "bounded" and "free"."""
    chance = random.Random(seed)

    def between(low: float, high: float) -> float:
        return round(chance.uniform(low, high), 2)

    numbers = {
        "a": between(0.9, 1.4), "b": between(9, 13), "c": between(27, 38), "p": between(0, 360),
        "x": between(-4, 4), "y": between(-4, 4), "r": between(26, 34), "s": between(14, 19),
        "q": between(150, 230), "k": between(3, 7), "u": between(9.5, 11), "v": between(9, 12),
        "w": between(-2, 2),
    }  # fmt: skip
    loops = _IJ if name == "staggered row" else _J
    count = {"spiral": 16, "arc": 14, "staggered row": 7}[name]
    tilt, turn = chance.uniform(15, 45), chance.uniform(0, 2 * math.pi)
    normal = (
        math.sin(math.radians(tilt)) * math.cos(turn),
        math.sin(math.radians(tilt)) * math.sin(turn),
        math.cos(math.radians(tilt)),
    )
    camera = Camera.from_normal(normal)
    kind = KINDS[name]
    x, y = kind.program.format(**numbers).split("|")
    text = _sketch(x, y, loops.format(n=count))
    text = text.replace("rx=??, ry=??", f"rx={camera.rx_deg:.2f}, ry={camera.ry_deg:.2f}")
    stop = {"bounded": f"??({count - 4}, {count + 4})", "free": "??"}
    sketches: dict[str, Sketch] = {}
    for width, form in (("bounded", kind.bounded), ("free", kind.free)):
        found = parse_sketch(_sketch(*form.split("|"), loops.format(n=stop[width])))
        assert isinstance(found, Sketch), found
        sketches[width] = found
    return program_scene(p3i.loads(text), seed, look=LOOKS[seed % len(LOOKS)]), sketches


@dataclass(frozen=True, slots=True)
class Row:
    """What came of one scene; without an answer the pose is 90 degrees off and nothing is found."""

    pose_deg: float
    f1: float
    seconds: float


def measure(scene: Scene, sketch: Sketch) -> Row:
    """Fill the sketch on the scene and hold the answer to the truth."""
    begun = time.process_time()
    result = p3i.synth(scene.image(), sketch=sketch)
    seconds = time.process_time() - begun
    if result.program is None or not result.centers:
        return Row(90.0, 0.0, seconds)
    pairs = zip(Camera.of(result.program).normal, scene.camera.normal, strict=True)
    pose_deg = math.degrees(math.acos(min(1.0, sum(a * b for a, b in pairs))))
    found = np.array(result.centers)[:, :2]
    apart = np.linalg.norm(found[:, None] - scene.centers_px[None], axis=2)
    hits = int((apart.min(axis=0) < HIT * spacing_px(scene)).sum())
    return Row(pose_deg, 2 * hits / (len(found) + len(scene.centers_px)), seconds)


def main() -> None:
    """Print one row of the table for each kind."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--scenes", type=int, default=4)
    parser.add_argument("--open", action="store_true", help="holes without bounds")
    options = parser.parse_args()
    width = "free" if options.open else "bounded"
    print("| sketch | holes | scenes | pose, median | under 2 degrees | F1, mean | CPU s |")
    print("|---|---|---|---|---|---|---|")
    for name in KINDS:
        rows = [
            measure(scene, sketches[width])
            for scene, sketches in (scene_of(name, seed) for seed in range(options.scenes))
        ]
        sure = sum(row.pose_deg < 2 for row in rows)
        print(
            f"| {name} | {width} | {len(rows)} | {statistics.median(row.pose_deg for row in rows):.2f} "
            f"| {sure} | {statistics.mean(row.f1 for row in rows):.2f} "
            f"| {statistics.mean(row.seconds for row in rows):.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
