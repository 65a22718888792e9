"""The printed score as a probability: fitted to answers of known truth, and held to it.

python benchmarks/calibration.py photos SET PHOTOS.jsonl --count 300   # annotated photos, most of them spoilt
python benchmarks/calibration.py scenes SCENES.jsonl --count 300       # and rendered scenes
python benchmarks/calibration.py fit --photos PHOTOS.jsonl --scenes SCENES.jsonl

The first two add a line a picture to a file that is there already: they may be stopped, begun again, and
shared among processes (--first, --count, a file each). Pictures are spoilt so that wrong answers exist. `fit`
prints the coefficients of p3i/search/judge/probability.py, each with its standard error, and the reliability
diagram: answers in ten bins of the probability that they are told, with the share of them that is right. What
the diagram tells of an answer comes from coefficients that were fitted without its half of the photos and
scenes (as of `p3i eval --fold`). `check` draws the same diagram of the scores as p3i says them, and fits
nothing.

Refused pictures have no score and are left out. Photos count as much as scenes: an answer of the fewer kind
weighs more.
"""

import argparse
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import robustness

import p3i
from p3i.evaluation.folds import Fold
from p3i.evaluation.looks import Random, texture
from p3i.evaluation.measures import measure
from p3i.evaluation.scenes import Scene, annotation, scene
from p3i.evaluation.truth import Truth, truth_of
from p3i.grammar.ast import Program
from p3i.search.judge.probability import COEFFICIENTS, RIGHT_WITHIN_DEG, Signs, probability, terms
from p3i.search.result import StructureFound
from p3i.vision.image import Image

Array = np.ndarray

FIRST_SEED = 700_000
"""Scenes of this seed and above are of no other benchmark."""
BINS = 10
PRIOR_SPREAD = 0.5
"""Coefficients of the terms, each scaled to a spread of 1, are about 0 give or take this much beforehand."""


STRUCTURES: tuple[StructureFound, ...] = ("lattice", "circular", "lattice", "hybrid", "circular")
HARMS: tuple[tuple[str, float, float], ...] = (
    ("none", 0, 0),
    ("blur", 3, 8),
    ("noise", 0.1, 0.4),
    ("faint", 0.2, 0.04),
    ("covered", 0.3, 0.7),
    ("part", 0.4, 0.1),
    ("small", 0.5, 0.2),
)
"""What is done to photos and scenes, by turns, between which amounts: pixels of blur (at 640), the spread of
noise, the contrast that is left, the share covered by blobs, the share that is known, the side that is left.
"""


def spoilt(image: Image, turn: int, seed: int) -> tuple[str, Image]:
    """A picture after the harm whose turn it is, and what that was."""
    random = np.random.default_rng([FIRST_SEED, seed])
    harm, mild, hard = HARMS[turn % len(HARMS)]
    if harm == "none":
        return harm, image
    amount = mild * (hard / mild) ** float(random.uniform())
    pixels, valid = image.pixels, image.valid
    if harm == "blur":
        pixels = cv2.GaussianBlur(pixels, (0, 0), amount * image.size.longer / 640)
    elif harm == "noise":
        pixels = pixels + random.normal(0, amount, pixels.shape)
    elif harm == "faint":
        pixels = 0.5 + amount * (pixels - pixels.mean()) + random.normal(0, 0.03, pixels.shape)
    elif harm == "covered":
        pixels = _covered(pixels, amount, random)
    elif harm == "part":
        valid = valid & _part(image, amount, random)
    else:
        size = (round(image.size.width * amount), round(image.size.height * amount))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        valid = cv2.resize(valid.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    pixels = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.float32) / 255
    return f"{harm} {amount:.2g}", replace(image, pixels=np.ascontiguousarray(pixels), valid=valid)


def _covered(pixels: Array, share: float, random: Random) -> Array:
    """Blobs of an uneven colour, as of leaves or people, over a share of the picture."""
    height, width = pixels.shape[:2]
    hidden, longer = np.zeros((height, width), np.uint8), max(height, width)
    while hidden.mean() < share:
        middle = (int(random.integers(width)), int(random.integers(height)))
        sides = (int(longer * random.uniform(0.03, 0.1)), int(longer * random.uniform(0.03, 0.1)))
        cv2.ellipse(hidden, middle, sides, float(random.uniform(0, 180)), 0, 360, 1, -1)
    return np.where(hidden[..., None] > 0, texture(random, height, width), pixels)


def _part(image: Image, share: float, random: Random) -> Array:
    """A rectangle of so much of the picture, anywhere: bool [H, W]."""
    height, width = image.valid.shape
    tall, wide = round(math.sqrt(share) * height), round(math.sqrt(share) * width)
    y, x = int(random.integers(height - tall + 1)), int(random.integers(width - wide + 1))
    known = np.zeros((height, width), bool)
    known[y : y + tall, x : x + wide] = True
    return known


def scene_of(number: int) -> tuple[str, Scene, Image]:
    """Scene `number`: what was done to it, its truth, its picture. Some lattices are of robustness.py."""
    structure, seed = STRUCTURES[number % len(STRUCTURES)], FIRST_SEED + number
    random = np.random.default_rng([seed, 3])
    if structure == "lattice" and random.random() < 0.5:
        levels = [(harm, level) for harm, some in robustness.harms().items() for level in some]
        harm, level = levels[int(random.integers(len(levels)))]
        drawn = robustness.harms()[harm][level](seed)
        return f"lattice {harm} {level}", drawn, drawn.image()
    drawn = scene(structure, seed, **({"focals": True} if structure == "circular" else {}))
    name, image = spoilt(drawn.image(), number // len(STRUCTURES), number)
    return f"{structure} {name}", drawn, image


def search_scenes(out: Path, numbers: Iterable[int]) -> None:
    """Search scenes and add a line for each to `out`: the answer, and the truth beside it."""
    for number in _to_do(out, numbers):
        harm, drawn, image = scene_of(number)
        name = f"{number:04}"
        # The truth of a scene is known to the last digit, however well its objects tell it.
        truth = annotation(drawn, name) | {"pose_reliable": True}
        _searched(out, image, {"image": name, "number": number, "harm": harm, "truth": truth})


def search_photos(folder: Path, out: Path, numbers: Iterable[int]) -> None:
    """Search annotated photos and add a line for each to `out`.

    Photo and harm follow from the number: the first numbers are the photos as they are, one after another;
    the next are all of them again, spoilt by turns; and so on, until each has suffered everything.
    """
    entries = json.loads((folder / "annotations.json").read_text(encoding="utf-8"))
    for number in _to_do(out, numbers):
        again, which = divmod(number, len(entries))
        entry = entries[which]
        photo = folder / entry["file"]
        photo = photo if photo.is_file() else folder / "images" / photo.name
        turn = 0 if again == 0 else 1 + (which + again) % (len(HARMS) - 1)
        harm, image = spoilt(p3i.read_image(photo), turn, number)
        name = f"{number:04} {Path(entry['file']).name}"
        _searched(out, image, {"image": name, "number": number, "harm": harm, "truth": entry})


def _to_do(out: Path, numbers: Iterable[int]) -> Iterator[int]:
    """Those of the numbers that have no line in `out` yet, shuffled: a part of them is like them all."""
    done = {record["number"] for record in _lines(out)} if out.exists() else set()
    left = list(numbers)
    np.random.default_rng(FIRST_SEED).shuffle(left)
    return (number for number in left if number not in done)


def _searched(out: Path, image: Image, told: dict[str, Any]) -> None:
    """Search a picture and add a line to `out`: what `synth --format jsonl` says, and what is told of it."""
    result = p3i.synth(image)
    answer = {"program": None, "error": result.reason} if result.program is None else result.record()
    with out.open("a", encoding="utf-8") as stream:
        stream.write(json.dumps(answer | told) + "\n")
    said = "refused" if result.program is None else f"{result.structure}, score {result.score:.2f}"
    print(f"{told['image']:30} {told['harm']:24} {said}", flush=True)


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    for line in path.read_text(encoding="utf-8").splitlines():
        yield json.loads(line)


@dataclass(frozen=True, slots=True)
class Told:
    """An answer of known truth: where it is from, its fold, what it is judged by, whether it is right."""

    source: str
    name: str
    fold: int
    signs: Signs
    right: bool


def told_answers(source: str, records: Sequence[Mapping[str, Any]]) -> list[Told]:
    """The answers among the lines of a journal, each held to its truth and in the fold of its photo.

    Without those for photos whose true pose nobody knows well enough.
    """
    truths = {truth.file: truth for truth in (truth_of(record["truth"]) for record in records)}
    first = {truth.file for truth in Fold(1, 2).of(list(truths.values()))}
    found = []
    for record in records:
        truth = truth_of(record["truth"])
        if not record.get("program") or not truth.pose_reliable:
            continue
        fold = 1 if truth.file in first else 2
        right = is_right(p3i.loads(record["program"]), truth)
        name = f"{record['image']} {record['harm']}"
        found.append(Told(source, name, fold, signs_of(record), right))
    return found


def is_right(program: Program, truth: Truth) -> bool:
    """Whether a program has the true structure, lattice and pose."""
    found = measure(program, truth)
    return found.structure_ok and found.lattice_ok is not False and found.pose_deg <= RIGHT_WITHIN_DEG


def signs_of(record: Mapping[str, Any]) -> Signs:
    """What an answer's line of JSON says of the quantities that its score is made of."""
    return Signs(
        structure=record["structure"],
        bits=record["bits"],
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
    scenes = verbs.add_parser("scenes", help="search rendered scenes")
    photos = verbs.add_parser("photos", help="search annotated photos, as they are and spoilt")
    photos.add_argument("set", type=Path)
    for verb in (scenes, photos):
        verb.add_argument("out", type=Path, help="JSON lines, added to")
        verb.add_argument("--count", type=int, default=300, help="up to this number")
        verb.add_argument("--first", type=int, default=0, help="from this number on")
    fitted = verbs.add_parser("fit", help="fit the coefficients, and draw the diagram, cross-fitted")
    checked = verbs.add_parser("check", help="draw the diagram of the scores as p3i says them")
    for verb in (fitted, checked):
        verb.add_argument("--photos", type=Path, nargs="*", default=[], help="what `photos` wrote")
        verb.add_argument("--scenes", type=Path, nargs="*", default=[], help="what `scenes` wrote")
        verb.add_argument("--list", action="store_true", help="every answer that is wrong or told below 0.5")
    given = parser.parse_args()
    if given.verb == "scenes":
        search_scenes(given.out, range(given.first, given.count))
    elif given.verb == "photos":
        search_photos(given.set, given.out, range(given.first, given.count))
    else:
        told: list[Told] = []
        for source, paths in (("photos", given.photos), ("scenes", given.scenes)):
            told += told_answers(source, [record for path in paths for record in _lines(path)])
        _report(told, fitting=given.verb == "fit", listing=given.list)


def _report(told: Sequence[Told], *, fitting: bool, listing: bool) -> None:
    """Coefficients if they are to be fitted, and the diagrams."""
    likely = cross_fitted(told) if fitting else np.array([probability(one.signs) for one in told])
    if fitting:
        _print_coefficients(told)
    for source in sorted({one.source for one in told}):
        own = [k for k, one in enumerate(told) if one.source == source]
        diagram(source, [told[k] for k in own], likely[own])
    diagram("all, photos and scenes with equal weight", told, likely)
    if listing:
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
