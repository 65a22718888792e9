"""What single parts of the search are worth: each switched off, on the lattices of an annotated set.

python benchmarks/ablations.py SET                       # all configurations, all lattices
python benchmarks/ablations.py SET --every 2             # every second one
python benchmarks/ablations.py SET --rows rows.jsonl     # write what is measured down, and go on from there
python benchmarks/ablations.py SET --only default "no refinement"

SET is a folder as `p3i eval` reads it (docs/evaluation.md). Searches with `structure="lattice"`, for speed.
Each photo is searched in every configuration before the next one comes, so that a run that is ended early,
or that shares its core, compares like with like; the table counts the photos that all configurations have.
Parts are switched off from outside, by replacing functions: the product has no such switches.
"""

import argparse
import contextlib
import json
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

import p3i
from p3i.errors import P3IError
from p3i.evaluation.measures import Measures, measure
from p3i.evaluation.score_set import Row, summarise
from p3i.evaluation.truth import Truth, read_truth
from p3i.search.look import correlate, evidence
from p3i.search.propose import shifts as by_shifts

Replacement = tuple[str, Callable[..., Any]]
Rows = dict[tuple[str, str], dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Configuration:
    """A search to measure: its features, and functions of p3i (dotted names) that others stand in for."""

    features: str = "oriented"
    replaced: tuple[Replacement, ...] = ()

    @contextlib.contextmanager
    def applied(self) -> Iterator[None]:
        """The search as this configuration wants it, while the context lasts."""
        with contextlib.ExitStack() as stack:
            for name, stand_in in self.replaced:
                stack.enter_context(patch(name, stand_in))
            yield


def as_proposed(level: object, pattern: object, theta: Tensor, *args: object, **options: object) -> Tensor:
    """In the place of every fit: the numbers as they came."""
    return theta


def as_they_are(values: Tensor, valid: Tensor) -> Tensor:
    """In the place of the local normalisation: no mean taken off, nothing divided by the energy around.

    What follows scales the whole map to a mean energy of 1, as always.
    """
    return values * valid


def mean_taken_off(values: Tensor, valid: Tensor) -> Tensor:
    """In the place of the local normalisation: the local mean taken off, the division by energy left out.

    The mean as in the product, a Gaussian of a tenth of the longer side, by way of a small map.
    """
    height, width = valid.shape
    known = valid.numpy().astype(np.float32)
    factor = max(1.0, 0.1 * max(height, width) / 4)
    coarse = max(1, round(width / factor)), max(1, round(height / factor))

    def smooth(plane: np.ndarray) -> np.ndarray:
        small = cv2.resize(plane, coarse, interpolation=cv2.INTER_AREA)
        return cv2.GaussianBlur(small, (0, 0), 4, borderType=cv2.BORDER_CONSTANT)

    weight = np.maximum(smooth(known), 1e-6)
    means = [cv2.resize(smooth(plane * known) / weight, (width, height)) for plane in values.numpy()]
    return (values - torch.from_numpy(np.stack(means))) * valid


def difference_agreement(a: Tensor, b: Tensor, known: Tensor) -> Tensor:
    """In the place of `cells.agreement`: 1 - |a - b|^2 / 2, a mean over the known samples.

    The squared difference of equation 2 with the same unit (a map of mean energy 1) for every pair of cells,
    where the search divides by the energy of the two.
    """
    apart = ((a - b).square().sum(-1) * known).sum(-1)
    return 1 - apart / (2 * known.sum(-1).clamp(min=1))


def difference_correlate(planes: Tensor, known: Tensor, templates: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """In the place of `correlate.correlate`: the least squared difference, not the highest agreement."""
    count, channels, wide, _ = planes.shape
    side = templates.shape[-1]
    kernel = templates.reshape(-1, 1, side, side)
    inner = F.conv2d(planes.reshape(1, count * channels, wide, wide), kernel, groups=kernel.shape[0])
    inner = inner.reshape(count, channels, *inner.shape[-2:]).sum(1)
    ones = torch.ones(1, 1, side, side)
    energy = F.conv2d(planes.square().sum(1, keepdim=True), ones)[:, 0]
    squared = templates.square().sum(1)
    of_template = F.conv2d(known.reshape(1, count, wide, wide), squared[:, None], groups=count)[0]
    samples = F.conv2d(known, ones)[:, 0].clamp(min=1)
    return correlate._peaks(1 - (energy + of_template - 2 * inner) / (2 * samples))


def difference_autocorrelation(view: np.ndarray, weights: np.ndarray) -> by_shifts.Autocorrelation:
    """In the place of `autocorrelation`: 1 - half the mean squared difference of a view and its copy."""
    side = cv2.getOptimalDFTSize(int(1.5 * max(weights.shape)))

    def spectrum(plane: np.ndarray) -> np.ndarray:
        padded = np.zeros((side, side), np.float32)
        padded[: plane.shape[0], : plane.shape[1]] = plane
        return cv2.dft(padded, nonzeroRows=plane.shape[0])

    def correlation(product: np.ndarray) -> np.ndarray:
        return cv2.idft(product, flags=cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT)

    power = np.zeros((side, side), np.float32)
    for channel in range(view.shape[2]):
        one = spectrum(np.ascontiguousarray(view[:, :, channel] * weights))
        power += cv2.mulSpectrums(one, one, 0, conjB=True)
    of_weights = spectrum(weights)
    of_energy = spectrum(weights * np.einsum("hwc,hwc->hw", view, view))
    crossed = correlation(cv2.mulSpectrums(of_energy, of_weights, 0, conjB=True))
    both = crossed + np.roll(crossed[::-1, ::-1], (1, 1), (0, 1))
    overlap = correlation(cv2.mulSpectrums(of_weights, of_weights, 0, conjB=True))
    whole = max(float(overlap[0, 0]), 1e-9)
    judged = overlap > by_shifts._LEAST_OVERLAP * whole
    apart = (both - 2 * correlation(power)) / (2 * np.maximum(overlap, 1e-6 * whole))
    values = np.where(judged, 1 - apart, -1)
    trust = np.sqrt(np.clip(overlap / whole, 0, 1))
    shifted = (np.fft.fftshift(one) for one in (values.astype(np.float32), judged, trust))
    return by_shifts.Autocorrelation(*shifted, pixels=float(weights.sum()))


_BLURRED = evidence._level


def level_of_unit_energy(
    seen: evidence.Evidence, features: evidence.FeatureMap, blur: float
) -> evidence.Level:
    """A blurred map scaled back to mean energy 1: the unit of the differences, one for a photo and a blur.

    Without it all differences shrink with the blur, and the thresholds would measure that.
    """
    level = _BLURRED(seen, features, blur)
    energy = level.values.square().sum(0)[level.valid].mean() if bool(level.valid.any()) else torch.ones(())
    stack = level.stack / energy.clamp(min=1e-12).sqrt()
    return evidence.Level(stack, level.valid, level.map_from_photo, level.photo_size, level.focal_mm)


NO_REFINEMENT: tuple[Replacement, ...] = (
    ("p3i.search.fit.grow.refine", as_proposed),
    ("p3i.search.fit.grow.on_instances", as_proposed),
    ("p3i.search.extent.lattice.refitted", lambda _, layout: layout),
)
NO_LOCAL: tuple[Replacement, ...] = (("p3i.vision.features.locally_normalized", as_they_are),)
NO_LOCAL_ENERGY: tuple[Replacement, ...] = (("p3i.vision.features.locally_normalized", mean_taken_off),)
NO_ENERGY: tuple[Replacement, ...] = (
    ("p3i.search.look.evidence._level", level_of_unit_energy),
    ("p3i.search.look.cells.agreement", difference_agreement),
    ("p3i.search.fit.grow.agreement", difference_agreement),
    ("p3i.search.extent.primitive.agreement", difference_agreement),
    ("p3i.search.look.correlate.correlate", difference_correlate),
    ("p3i.search.propose.windows.autocorrelation", difference_autocorrelation),
)

CONFIGURATIONS = {
    "default": Configuration(),
    "rgb": Configuration("rgb"),
    "oriented+lite0": Configuration("oriented+lite0"),
    "no refinement": Configuration(replaced=NO_REFINEMENT),
    "no local normalisation": Configuration(replaced=NO_LOCAL),
    "local mean only": Configuration(replaced=NO_LOCAL_ENERGY),
    "no division by energy": Configuration(replaced=NO_ENERGY),
    "neither of the two": Configuration(replaced=NO_LOCAL_ENERGY + NO_ENERGY),
}

COLUMNS = (
    ("answered", "answered", "{:.0%}"), ("pose, median of all", "pose_median", "{:.2f}"),
    ("mean of the answered", "pose_mean_answered", "{:.2f}"), ("right lattice", "lattice_ok", "{:.0%}"),
    ("F1", "f1", "{:.2f}"), ("F1 free", "f1_free", "{:.2f}"),
    ("Chamfer of the answered", "chamfer_answered", "{:.3f}"),
)  # fmt: skip


def measured(photo: Path, truth: Truth, configuration: Configuration) -> dict[str, Any]:
    """One search: the photo's measures (the worst without an answer), why none, agreement, CPU seconds."""
    begun = time.process_time()
    found, error, score = Measures(lattice_ok=False), "", None
    try:
        with configuration.applied():
            result = p3i.synth(photo, structure="lattice", features=configuration.features)
        score = result.agreement
        if result.program is None:
            error = result.reason
        else:
            found = measure(result.program, truth)
    except P3IError as failure:
        error = str(failure)
    told = {name: getattr(found, name) for name in Measures.__dataclass_fields__}
    return {"measures": told, "error": error, "score": score, "cpu": time.process_time() - begun}


def table(rows: Rows, names: Sequence[str], truths: Sequence[Truth]) -> str:
    """The Markdown table over the photos that every configuration has searched."""
    done = [truth for truth in truths if all((name, truth.file) in rows for name in names)]
    lines = [
        f"{len(done)} photos",
        "| configuration | " + " | ".join(title for title, _, _ in COLUMNS) + " | CPU s a photo |",
        "|---" * (len(COLUMNS) + 2) + "|",
    ]
    for name in names if done else ():
        own = [rows[name, truth.file] for truth in done]
        scored = [
            Row(
                file=truth.file,
                structure=truth.structure,
                pose_reliable=truth.pose_reliable,
                measures=Measures(**told["measures"]),
                error=told["error"],
            )
            for truth, told in zip(done, own, strict=True)
        ]
        means = summarise(scored)["all"]
        values = [(means[key], form) for _, key, form in COLUMNS]
        cells = ["-" if value is None else form.format(value) for value, form in values]
        cpu = statistics.mean(told["cpu"] for told in own)
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {cpu:.1f} |")
    return "\n".join(lines)


def _photo(folder: Path, truth: Truth) -> Path:
    """A photo's file: as the annotation names it, or in images/."""
    direct = folder / truth.file
    return direct if direct.is_file() else folder / "images" / Path(truth.file).name


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("set", type=Path, help="folder with annotations.json and images/")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="only every Nth lattice photo")
    parser.add_argument("--only", nargs="+", choices=CONFIGURATIONS, metavar="NAME", help="configurations")
    parser.add_argument("--rows", type=Path, help="JSON lines: written as measured, and read to go on")
    given = parser.parse_args()
    names: list[str] = given.only or list(CONFIGURATIONS)
    written: Path | None = given.rows
    truths = [one for one in read_truth(given.set) if one.structure == "lattice"][:: given.every]
    rows: Rows = {}
    if written is not None and written.is_file():
        for line in written.read_text().splitlines():
            told = json.loads(line)
            rows[told["configuration"], told["file"]] = told
    try:
        # Loading torch and the weights is no part of any photo's time.
        measured(_photo(given.set, truths[0]), truths[0], CONFIGURATIONS["oriented+lite0"])
        for truth in truths:
            for name in names:
                if (name, truth.file) in rows:
                    continue
                told: dict[str, Any] = {"configuration": name, "file": truth.file}
                told |= measured(_photo(given.set, truth), truth, CONFIGURATIONS[name])
                rows[name, truth.file] = told
                if written is not None:
                    with written.open("a") as stream:
                        stream.write(json.dumps(told) + "\n")
                said = told["measures"]
                print(
                    f"{Path(truth.file).name[:40]:40} {name:22} pose {said['pose_deg']:6.2f}  "
                    f"f1 free {said['f1_free']:.2f}  lattice {said['lattice_ok']!s:5} "
                    f"score {told['score'] or 0:.3f}  {told['cpu']:.1f} s  {told['error'][:60]}",
                    flush=True,
                )
    except KeyboardInterrupt:
        pass
    print("\n" + table(rows, names, truths))


if __name__ == "__main__":
    main()
