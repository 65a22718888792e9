"""Make the weights that the painting network starts from, from rendered scenes alone.

python scripts/train_npn.py p3i/paint/fill/npn/weights.npz        # about 5 CPU minutes on one core

Scenes are those of `p3i examples` (p3i.evaluation.scenes), with other seeds: six in ten lattices, a quarter
rings, the rest rings in a row; objects differ and pixels are noisy to a degree drawn anew for each, and each
object's place is a little off, as it is in a program that was searched for. Of every scene a few lessons are
cut, and a step takes its lessons from one of the latest scenes. All chance follows from the seed: on one
machine with one version of PyTorch the same command makes the same file. The last line is the file's sha256,
for p3i/paint/fill/npn/shipped.py and docs/npn.md.
"""

import argparse
import dataclasses
import hashlib
import time
from collections import deque
from pathlib import Path

import cv2
import numpy as np
import torch

from p3i.evaluation.scenes import scene
from p3i.paint.fill.npn.cells import cells_of
from p3i.paint.fill.npn.lessons import lessons, part_of, teachers, varied
from p3i.paint.fill.npn.network import Batch, PaintingNetwork, plain
from p3i.paint.fill.npn.shipped import packed
from p3i.paint.fill.npn.stacks import pool_of
from p3i.paint.fill.npn.training import AT_ONCE, begun, hole_error, sharpness, step
from p3i.place.placed import placed

SEED = 0
STEPS = 2500
# Scenes of these seeds are learned from, of those judged by: far from those that `p3i examples` takes.
FIRST_SEED, FIRST_JUDGED = 500_000, 900_000
LESSONS, STEPS_A_SCENE, LATEST, JUDGED = 16, 20, 48, 8
RATE, LAST_RATE = 2e-3, 1e-4
STRAY_PX = 0.7


def cut(seed: int, *, count: int) -> Batch | None:
    """Lessons of one scene as one batch; None where the scene is too small to teach."""
    random = np.random.default_rng([SEED, seed])
    structure = ("lattice", "circular", "hybrid")[int(np.searchsorted([0.6, 0.85], random.random()))]
    drawn = scene(structure, seed, jitter=random.uniform(0.05, 0.8), noise=random.uniform(0.003, 0.05))
    photo = drawn.image()
    none = np.zeros(photo.valid.shape, bool)
    cells = cells_of(photo, placed(drawn.program, photo), none, none, device=torch.device("cpu"))
    stray = torch.eye(3, dtype=torch.float64).repeat(len(cells.views), 1, 1)
    stray[:, :2, 2] = torch.from_numpy(random.normal(0, STRAY_PX * random.random(), (len(stray), 2)))
    cells = dataclasses.replace(cells, views=cells.views @ stray)
    pool = pool_of(cells, torch.arange(min(1, len(cells.centers))))
    none_yet = torch.zeros(0, 1, cells.patch.height, cells.patch.width)
    found = lessons(cells, pool, teachers(cells, pool), none_yet, count=count, seed=seed)
    return max(found, key=lambda batch: len(batch.weights)) if found else None


def told(network: PaintingNetwork, judged: list[Batch]) -> str:
    """What a network makes of scenes that it has not seen, beside the weighted mean that it starts from."""
    rows = []
    with torch.no_grad():
        for batch in judged:
            truth = sharpness(batch.target, batch.asked)
            for fill in (plain(batch).fill, network(batch).fill):
                ratio = sharpness(fill, batch.asked) / truth
                rows.append((255 * float(hole_error(fill, batch).mean()), float(ratio.median())))
    (before, dull), (after, sharp) = np.array(rows[::2]).mean(0), np.array(rows[1::2]).mean(0)
    return f"L1 {before:.2f} -> {after:.2f}, sharpness {dull:.2f} -> {sharp:.2f} of the truth's"


def main() -> None:
    """Train, and write the weights."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=STEPS)
    asked = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    torch.use_deterministic_algorithms(True)
    begin = time.process_time()
    judged = [
        batch for seed in range(JUDGED) if (batch := cut(FIRST_JUDGED + seed, count=LESSONS)) is not None
    ]
    training = begun(seed=SEED, device=torch.device("cpu"), rate=RATE)
    latest: deque[Batch] = deque(maxlen=LATEST)
    seed = FIRST_SEED
    for turn in range(asked.steps):
        while turn % STEPS_A_SCENE == 0:
            fresh = cut(seed, count=LESSONS)
            seed += 1
            if fresh is not None:
                latest.append(fresh)
                break
        # From the first rate to the last, by half a wave.
        wave = 0.5 + 0.5 * np.cos(np.pi * turn / asked.steps)
        for steps in (training.generator_steps, training.discriminator_steps):
            steps.param_groups[0]["lr"] = LAST_RATE + (RATE - LAST_RATE) * wave
        chance = torch.Generator().manual_seed(SEED * 1_000_003 + turn)
        batch = latest[int(torch.randint(len(latest), (1,), generator=chance))]
        chosen = torch.randperm(len(batch.weights), generator=chance)[:AT_ONCE]
        step(training, varied(part_of(batch, chosen), chance))
        if turn % 500 == 0 or turn == asked.steps - 1:
            spent = time.process_time() - begin
            print(f"step {turn} {spent:.0f} CPU s, unseen scenes: {told(training.mean, judged)}", flush=True)
            data = packed(training.mean, training.discriminator)
            asked.out.write_bytes(data)
    print(
        f"scenes of seeds {FIRST_SEED} to {seed - 1}, judged by {FIRST_JUDGED} to {FIRST_JUDGED + JUDGED - 1}"
    )
    print(f"sha256 {hashlib.sha256(data).hexdigest()}")


if __name__ == "__main__":
    main()
