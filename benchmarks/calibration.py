"""The printed score as a probability: fitted to answers of known truth, and held to it.

python benchmarks/calibration.py scenes SCENES.jsonl --count 300   # search rendered scenes, half of them hard
p3i synth SET/images --format jsonl > PHOTOS.jsonl                 # and annotated photos
python benchmarks/calibration.py fit --set SET PHOTOS.jsonl --scenes SCENES.jsonl

`scenes` adds to a file that is there already, a line a scene, and may be stopped and begun again. `fit`
prints the coefficients of p3i/search/judge/probability.py, each with its standard error, and the reliability
diagram: answers in ten bins of the probability that they are told, with the share of them that is right. What
the diagram tells of an answer comes from coefficients that were fitted without its half of the photos and
scenes (`p3i eval --fold`). `check` draws the same diagram of the scores that the answers carry, and fits
nothing.

Refused pictures have no score and are left out. Photos count as much as scenes: an answer of the fewer kind
weighs more.
"""

import argparse
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import robustness

import p3i
from p3i.evaluation.folds import Fold
from p3i.evaluation.looks import Random, texture
from p3i.evaluation.measures import measure
from p3i.evaluation.scenes import Scene, annotation, scene
from p3i.evaluation.score_set import read_results
from p3i.evaluation.truth import Truth, read_truth, truth_of
from p3i.grammar.ast import Program
from p3i.search.judge.probability import COEFFICIENTS, RIGHT_WITHIN_DEG, Signs, terms
from p3i.search.result import StructureFound

Array = np.ndarray

FIRST_SEED = 700_000
"""Scenes of this seed and above are of no other benchmark."""
BINS = 10
PRIOR_SPREAD = 2.0
"""Coefficients of the terms, each scaled to a spread of 1, are about 0 give or take this much beforehand."""


STRUCTURES: tuple[StructureFound, ...] = ("lattice", "circular", "lattice", "hybrid", "circular")
HARMS: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("blur", (2.5, 5.0)),
    ("noise", (0.1, 0.3)),
    ("faint", (0.15, 0.06)),
    ("occlusion", (0.3, 0.6)),
    ("jpeg", (8.0,)),
    ("light", (12.0,)),
    ("part", (0.5, 0.3)),
)
"""What hard scenes suffer afterwards; lattices besides, or instead, all of benchmarks/robustness.py."""


def spoilt_scene(number: int) -> tuple[str, Scene]:
    """Scene `number` and what was done to it: every second block of five is spoilt, by turns."""
    structure, seed = STRUCTURES[number % len(STRUCTURES)], FIRST_SEED + number
    block, hard = divmod(number // len(STRUCTURES), 2)
    if not hard:
        return f"{structure} plain", scene(structure, seed)
    random = np.random.default_rng([seed, 3])
    if structure == "lattice" and random.random() < 0.5:
        levels = [(harm, level) for harm, some in robustness.harms().items() for level in some]
        harm, level = levels[int(random.integers(len(levels)))]
        return f"lattice {harm} {level}", robustness.harms()[harm][level](seed)
    harm, amounts = HARMS[block % len(HARMS)]
    amount = amounts[int(random.integers(len(amounts)))]
    drawn = scene(structure, seed)
    pixels = _spoilt(drawn, harm, amount, random)
    whole = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    return f"{structure} {harm} {amount:g}", replace(drawn, pixels=whole, jpeg=None)


def _spoilt(drawn: Scene, harm: str, amount: float, random: Random) -> Array:
    """The pixels of a scene after a harm, float [H, W, 3]."""
    pixels = drawn.pixels.astype(np.float32) / 255
    if harm == "faint":  # all greys alike but for a little, and the sensor's noise over that
        faint = 0.5 + amount * (pixels - pixels.mean())
        return faint + random.normal(0, 0.03, pixels.shape).astype(np.float32)
    if harm == "part":  # a wall before all but a part of the picture
        height, width = pixels.shape[:2]
        tall, wide = int(math.sqrt(amount) * height), int(math.sqrt(amount) * width)
        y, x = int(random.integers(height - tall + 1)), int(random.integers(width - wide + 1))
        wall = texture(random, height, width)
        wall[y : y + tall, x : x + wide] = pixels[y : y + tall, x : x + wide]
        return wall
    return robustness.AFTERWARDS[harm](drawn, amount, random)


def search_scenes(out: Path, *, count: int, first: int = 0) -> None:
    """Search scenes `first` to `count` and add a line for each to `out`: answer, and truth beside it."""
    done = {record["number"] for record in _lines(out)} if out.exists() else set()
    with out.open("a", encoding="utf-8") as stream:
        for number in range(first, count):
            if number in done:
                continue
            name, drawn = spoilt_scene(number)
            result = p3i.synth(drawn.image())
            told: dict[str, Any] = {"program": None, "error": result.reason}
            if result.program is not None:
                told = result.record()
            told |= {"image": f"{number:04}", "number": number, "harm": name}
            told["truth"] = annotation(drawn, f"{number:04}")
            stream.write(json.dumps(told) + "\n")
            stream.flush()
            said = "refused" if result.program is None else f"{result.structure}, score {result.score:.2f}"
            print(f"{number:4} {name:28} {said}", flush=True)


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    for line in path.read_text(encoding="utf-8").splitlines():
        yield json.loads(line)


@dataclass(frozen=True, slots=True)
class Told:
    """An answer of known truth: where it is from, what it is judged by, its score, whether it is right."""

    source: str
    name: str
    fold: int
    signs: Signs
    score: float
    right: bool


def told_answers(source: str, folder_truths: Sequence[Truth], records: Mapping[str, Any]) -> list[Told]:
    """The answers among the records of a set, by the photo's name, each held to its truth."""
    first = {truth.file for truth in Fold(1, 2).of(folder_truths)}
    found = []
    for truth in folder_truths:
        record = records.get(Path(truth.file).name) or {}
        program = p3i.loads(record["program"]) if record.get("program") else None
        if program is None:
            continue
        fold = 1 if truth.file in first else 2
        right = is_right(program, truth)
        found.append(Told(source, truth.file, fold, signs_of(record), float(record["score"]), right))
    return found


def is_right(program: Program, truth: Truth) -> bool:
    """Whether a program has the true structure, lattice and pose, the last where it can be asked for."""
    found = measure(program, truth)
    posed = found.pose_deg <= RIGHT_WITHIN_DEG or not truth.pose_reliable
    return found.structure_ok and found.lattice_ok is not False and posed


def signs_of(record: Mapping[str, Any]) -> Signs:
    """What an answer's line of JSON says of the quantities that its score is made of."""
    return Signs(
        structure=record["structure"],
        bits=record["bits"],
        objects=len(record["centers"]),
        agreement=record["agreement"],
        margin_bits=record["margin_bits"],
        pose_sigma_deg=record["camera"].get("pose_sigma_deg"),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Coefficients [T] of the terms, and their standard errors [T]."""

    coefficients: Array
    errors: Array

    def log_odds(self, rows: Array) -> Array:
        """Of the terms [N, T]."""
        return rows @ self.coefficients


def rows_of(told: Sequence[Told]) -> Array:
    """The terms of answers [N, T], in the order of COEFFICIENTS."""
    found = (terms(one.signs) for one in told)
    return np.array([[values[name] for name in COEFFICIENTS] for values in found])


def weights_of(told: Sequence[Told]) -> Array:
    """Weights [N] by which every source counts as much in all; their mean is 1."""
    sources = [one.source for one in told]
    return np.array([len(sources) / len(set(sources)) / sources.count(source) for source in sources])


def fit(rows: Array, right: Array, weights: Array) -> Fitted:
    """The logistic of the terms [N, T] that makes what is right [N] most likely, under a weak prior.

    Newton's method. The prior keeps coefficients finite where the answers are told apart without a fault; it
    is of each term at its own spread, and leaves the first (1 for every answer) free.
    """
    spread = rows.std(0)
    prior = np.maximum(spread**2 / PRIOR_SPREAD**2, 1e-6)
    found, bend = np.zeros(rows.shape[1]), np.diag(prior)
    for _ in range(50):
        likely = 1 / (1 + np.exp(-np.clip(rows @ found, -30, 30)))
        slope = rows.T @ (weights * (right - likely)) - prior * found
        bend = (rows * (weights * likely * (1 - likely))[:, None]).T @ rows + np.diag(prior)
        step = np.linalg.solve(bend, slope)
        found = found + step * min(1.0, 5 / max(float(np.abs(step).max()), 1e-9))
        if float(np.abs(step).max()) < 1e-8:
            break
    return Fitted(found, np.sqrt(np.diag(np.linalg.inv(bend))))


def cross_fitted(told: Sequence[Told]) -> Array:
    """The probability [N] of each answer by coefficients that were fitted on the other fold."""
    rows, weights = rows_of(told), weights_of(told)
    right = np.array([one.right for one in told], float)
    folds = np.array([one.fold for one in told])
    likely = np.zeros(len(told))
    for fold in (1, 2):
        own = folds == fold
        found = fit(rows[~own], right[~own], weights[~own])
        likely[own] = 1 / (1 + np.exp(-found.log_odds(rows[own])))
    return likely


def diagram(title: str, told: Sequence[Told], likely: Array) -> float:
    """Print the reliability diagram of probabilities [N]; returns the mean absolute error of calibration.

    That is the mean over the answers of how far what their bin was told, on the mean, lies from the share of
    the bin that is right. Most answers are told much the same and share a bin; so the error over ten bins of
    equally many answers is printed too.
    """
    right, weights = np.array([one.right for one in told], float), weights_of(told)
    print(f"\n{title}: {len(told)} answers, {right.mean():.1%} of them right")
    print("| told | mean told | right | answers |\n|---|---|---|---|")
    wide = np.minimum((likely * BINS).astype(int), BINS - 1)
    for number in range(BINS):
        own = wide == number
        if own.any():
            said, found = (np.average(what[own], weights=weights[own]) for what in (likely, right))
            span = f"{number / BINS:.1f} to {(number + 1) / BINS:.1f}"
            print(f"| {span} | {said:.2f} | {found:.2f} | {own.sum()} |")
    ranks = np.empty(len(told), int)
    ranks[np.argsort(likely, kind="stable")] = np.arange(len(told))
    error = _error(wide, likely, right, weights)
    even = _error(ranks * BINS // len(told), likely, right, weights)
    brier, rate = np.average((likely - right) ** 2, weights=weights), np.average(right, weights=weights)
    print(
        f"mean absolute error of calibration {error:.3f} (bins of equally many: {even:.3f}); "
        f"Brier score {brier:.3f}, of one number for all {rate * (1 - rate):.3f}"
    )
    return error


def _error(bins: Array, likely: Array, right: Array, weights: Array) -> float:
    """The mean distance, over answers [N] in bins [N], of what a bin was told from what is right of it."""
    return float(np.abs(np.bincount(bins, weights * (likely - right))).sum() / weights.sum())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    made = verbs.add_parser("scenes", help="search rendered scenes, and write answers with their truth")
    made.add_argument("out", type=Path)
    made.add_argument("--count", type=int, default=300, help="scenes up to this number")
    made.add_argument("--first", type=int, default=0, help="from this number on")
    for name, what in (
        ("fit", "fit the coefficients, cross-fitted"),
        ("check", "hold answers to their scores"),
    ):
        verb = verbs.add_parser(name, help=what)
        verb.add_argument("answers", type=Path, nargs="?", help="JSON lines of synth over the photos of SET")
        verb.add_argument("--set", type=Path, help="the annotated photos")
        verb.add_argument("--scenes", type=Path, nargs="*", default=[], help="what `scenes` wrote")
        verb.add_argument("--list", action="store_true", help="every answer that is wrong or told below 0.5")
    given = parser.parse_args()
    if given.verb == "scenes":
        search_scenes(given.out, count=given.count, first=given.first)
        return
    told: list[Told] = []
    if given.answers is not None:
        told += told_answers("photos", read_truth(given.set), read_results(given.answers))
    if given.scenes:
        records = [record for path in given.scenes for record in _lines(path)]
        truths = [truth_of(record["truth"]) for record in records]
        told += told_answers("scenes", truths, {record["image"]: record for record in records})
    scores = np.array([one.score for one in told])
    likely = cross_fitted(told) if given.verb == "fit" else scores
    if given.verb == "fit":
        _print_coefficients(told)
    for source in sorted({one.source for one in told}):
        own = [k for k, one in enumerate(told) if one.source == source]
        diagram(source, [told[k] for k in own], likely[own])
    diagram("all, photos and scenes with equal weight", told, likely)
    if given.list:
        for one, said in sorted(zip(told, likely, strict=True), key=lambda pair: pair[1]):
            if said < 0.5 or not one.right:
                what = "right" if one.right else "wrong"
                print(f"{one.source} {one.name:40} {said:.2f} {what} {one.signs}")


def _print_coefficients(told: Sequence[Told]) -> None:
    """The coefficients fitted to all answers, as probability.py has them."""
    found = fit(rows_of(told), np.array([one.right for one in told], float), weights_of(told))
    print(f"fitted to {len(told)} answers, {sum(not one.right for one in told)} of them wrong:")
    for name, value, error in zip(COEFFICIENTS, found.coefficients, found.errors, strict=True):
        print(f'    "{name}": {value:.2f},  # +- {error:.2f}')


if __name__ == "__main__":
    main()
