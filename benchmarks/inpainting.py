"""How well hidden parts of photos come back: p3i's ways to fill beside PatchMatch and OpenCV's, in one run.

python benchmarks/inpainting.py PHOTOS                       # an annotated set, as `p3i eval` takes it
python benchmarks/inpainting.py PHOTOS --methods stack telea --every 3
python benchmarks/inpainting.py PHOTOS --methods npn --steps 60 --out rows.jsonl

On each lattice photo 1, 2 and 4 whole cells of the annotation and a box of 1.2 cells are hidden, at places
drawn from the seed, and only then, all of them unknown, the program is searched for. Photos on which it is
not within tolerance of the annotation (the same lattice, its pose within 2 degrees) are counted and left out.
What each way puts into each hole, the others in sight, is compared with the photo: mean L1 (0 to 255), PSNR
and SSIM over the hole, CPU seconds.
Needs pypatchmatch (extra `patchmatch`) and scikit-image (extra `bench`).
"""

import argparse
import dataclasses
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import torch
from skimage.metrics import structural_similarity

import p3i
from p3i.evaluation.measures import measure
from p3i.evaluation.truth import Truth, read_truth
from p3i.options.inpaint import InpaintOptions
from p3i.paint.fill.inpaint import inpaint
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image
from p3i.vision.sheet import project

MOST_POSE_DEG = 2.0
_BLOCKS = {"1 cell": (1, 1), "2 cells": (2, 1), "4 cells": (2, 2)}
_LEAST_PX = 60
_MARGIN_PX = 2

Fill = Callable[[Image, p3i.Program, np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True, slots=True)
class Row:
    """What one way made of one hole; `l1` in 0..255, `ssim` over the hole's box."""

    photo: str
    hole: str
    method: str
    pixels: int
    l1: float
    psnr: float
    ssim: float
    cpu_s: float


def outline(laid: Placed, center: np.ndarray, width: float, height: float) -> np.ndarray | None:
    """width x height cells about a plane point, in pixels [4, 2]; None where they leave the photo."""
    assert laid.basis is not None
    turns = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * (width, height)
    points = np.c_[center + turns @ laid.basis, np.ones(4)] @ laid.image_from_plane.T
    if (points[:, 2] <= 0).any():
        return None
    pixels = points[:, :2] / points[:, 2:]
    limits = np.array([laid.size.width, laid.size.height]) - 1 - _MARGIN_PX
    return pixels if (pixels >= _MARGIN_PX).all() and (pixels <= limits).all() else None


def holes(laid: Placed, random: np.random.Generator) -> Iterator[tuple[str, np.ndarray]]:
    """The holes of a photo: what each is called, and bool [H, W]; fewer where the lattice is small."""
    assert laid.basis is not None

    def mask(corners: np.ndarray) -> np.ndarray:
        drawn = np.zeros((laid.size.height, laid.size.width), np.uint8)
        return cv2.fillConvexPoly(drawn, np.rint(corners).astype(np.int32), (1,)) > 0

    index = sorted(map(tuple, laid.index[laid.in_sight()].tolist()))
    whole = {}
    for one in index:
        corners = outline(laid, laid.at(np.array([one]))[0], 1, 1)
        if corners is not None and cv2.contourArea(corners.astype(np.float32)) >= _LEAST_PX:
            whole[one] = corners
    for name, (columns, rows) in _BLOCKS.items():
        steps = [(i, j) for i in range(columns) for j in range(rows)]
        fit = [one for one in whole if all((one[0] + i, one[1] + j) in whole for i, j in steps)]
        if not fit or len(whole) < 3 * len(steps) + 3:
            continue
        first = fit[random.integers(len(fit))]
        center = laid.at(np.array([first]) + (np.array([columns, rows]) - 1) / 2)[0]
        corners = outline(laid, center, columns, rows)
        if corners is not None:
            yield name, mask(corners)
    for _ in range(20 if whole else 0):
        first = list(whole)[random.integers(len(whole))]
        center = laid.at(np.array([first]) + random.uniform(-0.5, 0.5, (1, 2)))[0]
        corners = outline(laid, center, 1.2, 1.2)
        if corners is not None:
            yield "box", mask(corners)
            return


def annotated(truth: Truth, photo: Image) -> Placed:
    """The annotation as a program on its photo: all (i, j) between those of the marked objects."""
    assert truth.lattice is not None
    base, basis = (part / truth.size.unit_px for part in truth.lattice)
    on_plane, _ = project(np.linalg.inv(truth.camera.image_from_plane(truth.size).numpy()), truth.readings[0])
    index = np.rint((on_plane - base) @ np.linalg.inv(basis)).astype(int)
    (first_i, first_j), (last_i, last_j) = index.min(0).tolist(), index.max(0).tolist()
    x, y = (f"{basis[0, k]}*i + {basis[1, k]}*j + {base[k]}" for k in (0, 1))
    text = (
        f"SetCameraPose(rx={truth.camera.rx_deg}, ry={truth.camera.ry_deg})\n"
        f"for i in range({first_i}, {last_i + 1}):\n    for j in range({first_j}, {last_j + 1}):\n"
        f"        Draw(x={x}, y={y})\n"
    )
    return placed(p3i.loads(text), photo, focal_mm=truth.camera.focal_mm)


def fills(methods: list[str], *, steps: int) -> dict[str, Fill]:
    """The ways to fill, by name."""

    def ours(method: str) -> Fill:
        asked = InpaintOptions(method=method, steps=steps)
        return lambda photo, program, hole: inpaint(photo, program, asked, mask=hole).pixels

    def opencv(flag: int) -> Fill:
        def fill(photo: Image, _program: p3i.Program, hole: np.ndarray) -> np.ndarray:
            values = np.rint(photo.pixels * 255).astype(np.uint8)
            return cv2.inpaint(values, hole.astype(np.uint8), 3, flag).astype(np.float32) / 255

        return fill

    def plain_patchmatch(photo: Image, _program: p3i.Program, hole: np.ndarray) -> np.ndarray:
        from patchmatch import patch_match

        patch_match.set_random_seed(0)
        values = np.rint(photo.pixels * 255).astype(np.uint8)
        return patch_match.inpaint(values, hole.astype(np.uint8), patch_size=7).astype(np.float32) / 255

    known: dict[str, Fill] = {name: ours(name) for name in ("stack", "npn")}
    known["guided patchmatch"] = ours("patchmatch")
    known |= {
        "patchmatch": plain_patchmatch,
        "telea": opencv(cv2.INPAINT_TELEA),
        "ns": opencv(cv2.INPAINT_NS),
    }
    return {name: known[name] for name in methods}


def judged(photo: Image, filled: np.ndarray, hole: np.ndarray) -> tuple[float, float, float]:
    """Mean L1 (0 to 255) and PSNR (dB) over the hole, SSIM over its box."""
    before, after = (np.rint(one.clip(0, 1) * 255) for one in (photo.pixels, filled))
    off = (before - after)[hole]
    rows, columns = np.nonzero(hole)
    down, across = (slice(int(at.min()), max(int(at.max()) + 1, int(at.min()) + 7)) for at in (rows, columns))
    similar = structural_similarity(before[down, across], after[down, across], channel_axis=2, data_range=255)
    psnr = 10 * np.log10(255**2 / max(float((off**2).mean()), 1e-3))
    return float(np.abs(off).mean()), float(psnr), float(np.asarray(similar))


def main() -> None:
    """Measure, print a line a hole and the table of means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", type=Path)
    names = ["stack", "npn", "patchmatch", "guided patchmatch", "telea", "ns"]
    parser.add_argument("--methods", nargs="+", choices=names, default=names)
    parser.add_argument("--every", type=int, default=1, help="take every Nth photo")
    parser.add_argument("--seconds", type=float, help="begin no further photo after so long")
    parser.add_argument("--holes", nargs="+", help="only holes of these names")
    parser.add_argument("--steps", type=int, default=60, help="steps of training of npn")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="write a JSON line for each result")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    ways = fills(asked.methods, steps=asked.steps)
    begun, seen, missed = time.monotonic(), 0, 0
    rows: list[Row] = []
    with open(asked.out or os.devnull, "w", encoding="utf-8") as out:
        truths = [truth for truth in read_truth(asked.photos) if truth.structure == "lattice"]
        for number, truth in enumerate(truths[:: asked.every]):
            if asked.seconds is not None and time.monotonic() - begun > asked.seconds:
                break
            photo = p3i.read_image(asked.photos / truth.file)
            cut = [
                (name, hole)
                for name, hole in holes(annotated(truth, photo), np.random.default_rng([asked.seed, number]))
                if not (asked.holes and name not in asked.holes) and photo.valid[hole].all()
            ]
            if not cut:
                continue
            seen += 1
            program = p3i.synth(photo, mask=np.any([hole for _, hole in cut], axis=0)).program
            score = None if program is None else measure(program, truth)
            if program is None or score is None or not score.lattice_ok or score.pose_deg > MOST_POSE_DEG:
                missed += 1
                print(f"{truth.file:40s} no program within tolerance beside the holes", flush=True)
                continue
            for name, hole in cut:
                hidden = np.where(hole[:, :, None], np.float32(0), photo.pixels)
                given = dataclasses.replace(photo, pixels=hidden)
                for method, fill in ways.items():
                    started = time.process_time()
                    filled = fill(given, program, hole)
                    spent = time.process_time() - started
                    row = Row(truth.file, name, method, int(hole.sum()), *judged(photo, filled, hole), spent)
                    rows.append(row)
                    print(
                        f"{truth.file:40s} {name:8s} {method:18s} L1 {row.l1:6.2f} {spent:6.1f} s", flush=True
                    )
                    out.write(json.dumps(dataclasses.asdict(row)) + "\n")
    print(f"\n{seen} photos, {missed} of them without a program within tolerance beside their holes")
    print(f"{'method':18s} {'holes':>5s} {'L1':>7s} {'median':>7s} {'PSNR':>6s} {'SSIM':>6s} {'CPU s':>6s}")
    for method in ways:
        mine = [row for row in rows if row.method == method]
        if not mine:
            continue
        l1, psnr, ssim, cpu = np.array([[row.l1, row.psnr, row.ssim, row.cpu_s] for row in mine]).T
        print(
            f"{method:18s} {len(mine):5d} {l1.mean():7.2f} {np.median(l1):7.2f} {psnr.mean():6.2f} "
            f"{ssim.mean():6.3f} {cpu.mean():6.2f}"
        )


if __name__ == "__main__":
    main()
