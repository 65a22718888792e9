"""An annotated set scored: p3i over its photos (or answers made earlier), by photo and by structure."""

import concurrent.futures
import dataclasses
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from p3i.errors import FileError, P3IError, UsageError
from p3i.evaluation.folds import Fold
from p3i.evaluation.measures import Measures, measure
from p3i.evaluation.truth import STRUCTURES, Truth, read_truth
from p3i.files import read_text
from p3i.grammar.ast import Header, Program
from p3i.grammar.parser import parse
from p3i.grammar.printer import format_program
from p3i.search.config import SearchConfig
from p3i.search.synthesize import synthesize
from p3i.vision.image import read_image


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One photo of a set: its measures, or the worst that there are with `error`, the reason for it."""

    file: str
    structure: str
    pose_reliable: bool
    measures: Measures
    error: str = ""
    seconds: float | None = None

    def as_json(self) -> dict[str, Any]:
        """The row as one flat object."""
        told: dict[str, Any] = {"file": self.file, "structure": self.structure}
        told |= {"pose_reliable": self.pose_reliable, **dataclasses.asdict(self.measures)}
        told["seconds"] = self.seconds
        return told | ({"error": self.error} if self.error else {})


@dataclass(frozen=True, slots=True, kw_only=True)
class SetScore:
    """A set scored: rows in its order, means by structure, and its cost (None for answers made earlier).

    `fold` says which part of the set was scored, as "1/2"; None for all of it.
    """

    rows: tuple[Row, ...]
    summary: Mapping[str, Mapping[str, float | None]]
    wall: float | None = None
    cpu: float | None = None
    peak_mb: float | None = None
    fold: str | None = None

    def as_json(self) -> dict[str, Any]:
        """All of it for a file."""
        rows = [row.as_json() for row in self.rows]
        return {
            "fold": self.fold,
            "summary": self.summary,
            "rows": rows,
            "wall": self.wall,
            "cpu": self.cpu,
            "peak_mb": self.peak_mb,
        }


def score_set(
    folder: Path,
    config: SearchConfig,
    *,
    results: Path | None = None,
    jobs: int = 1,
    only: str | None = None,
    limit: int | None = None,
    fold: str | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> SetScore:
    """Score p3i with these options on a set, or, with `results`, a file of the JSON lines of `synth`.

    `fold`, as "1/2", takes a fixed part of the set (evaluation/folds.py); `only` keeps those of its photos
    whose name contains it, `limit` so many of them. Photos without an answer count
    with the worst measures. Raises FileError for a set or results that cannot be read, UsageError for counts
    out of range and where nothing is left to score.
    """
    if jobs < 1 or (limit is not None and limit < 1):
        raise UsageError("the number of jobs, and the limit, must be at least 1")
    part = None if fold is None else Fold.parse(fold)
    truths = read_truth(folder) if part is None else part.of(read_truth(folder))
    truths = [one for one in truths if only is None or only in one.file][:limit]
    if not truths:
        named = "" if only is None else f" has {only!r} in its name"
        raise UsageError(f"no photo of {folder}{named}" + ("" if part is None else f" is in fold {part}"))
    if results is not None:
        answers = read_results(results)
        rows = [_row(truth, answers.get(Path(truth.file).name)) for truth in truths]
        return SetScore(rows=tuple(rows), summary=summarise(rows), fold=fold)
    begun = time.perf_counter()
    records, cpu, peak = [], 0.0, 0.0
    for place, (record, used, memory) in enumerate(_answers(folder, truths, config, jobs)):
        records.append(record)
        cpu, peak = cpu + used, max(peak, memory)
        if progress is not None:
            progress(f"{place + 1} of {len(truths)} photos", (place + 1) / len(truths))
    rows = [_row(truth, record) for truth, record in zip(truths, records, strict=True)]
    wall = time.perf_counter() - begun
    return SetScore(rows=tuple(rows), summary=summarise(rows), wall=wall, cpu=cpu, peak_mb=peak, fold=fold)


def summarise(rows: Sequence[Row]) -> dict[str, dict[str, float | None]]:
    """Means over all rows and by structure; those called `answered` leave out photos without an answer."""
    groups = {"all": list(rows)}
    groups |= {name: [row for row in rows if row.structure == name] for name in STRUCTURES}
    return {name: _means(group) for name, group in groups.items() if group}


def _means(rows: Sequence[Row]) -> dict[str, float | None]:
    posed = [row for row in rows if row.pose_reliable]
    answered = [row for row in rows if not row.error]
    pose = [row.measures.pose_deg for row in posed]

    def mean(name: str, among: Iterable[Row]) -> float | None:
        values = [getattr(row.measures, name) for row in among]
        return _mean([value for value in values if value is not None])

    return {
        "n": len(rows),
        "failed": len(rows) - len(answered),
        "answered": len(answered) / len(rows),
        "pose_mean_answered": mean("pose_deg", [row for row in answered if row.pose_reliable]),
        "chamfer_answered": mean("chamfer", answered),
        "pose_mean": mean("pose_deg", posed),
        "pose_median": float(np.median(pose)) if pose else None,
        "pose_l1": mean("pose_l1", posed),
        "pose<2": _mean([value <= 2 for value in pose]),
        "pose<5": _mean([value <= 5 for value in pose]),
        **{name: mean(name, rows) for name in ("det_gt", "gt_det", "chamfer", "f1", "f1_free")},
        "lattice_ok": mean("lattice_ok", rows),
        "structure_ok": mean("structure_ok", rows),
        "seconds": _mean([row.seconds for row in rows if row.seconds is not None]),
    }


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _row(truth: Truth, record: Mapping[str, Any] | None) -> Row:
    """The row of a photo from its record; any record that holds no readable program is a failure."""
    said = record or {}
    text, seconds = said.get("program"), said.get("seconds")
    error = str(said.get("error") or "no answer")
    seconds = float(seconds) if isinstance(seconds, int | float) else None
    worst = Measures(lattice_ok=False if truth.structure == "lattice" else None)
    found = parse(text) if isinstance(text, str) else None
    if isinstance(found, Program):
        try:
            worst, error = measure(found, truth), ""
        except P3IError as failure:  # a program that draws millions
            error = str(failure)
    elif found:
        error = f"its program cannot be read: {found[0].message}"
    return Row(
        file=truth.file,
        structure=truth.structure,
        pose_reliable=truth.pose_reliable,
        measures=worst,
        error=error,
        seconds=seconds,
    )


def read_results(path: Path) -> dict[str, Mapping[str, Any]]:
    """The records of a JSON Lines file by the photo's name; lines that are no record are passed over.

    Raises FileError for a file that cannot be read or holds no record.
    """
    lines = read_text(path).splitlines()
    found: dict[str, Mapping[str, Any]] = {}
    for line in lines:
        try:
            record = json.loads(line)
        except ValueError:
            continue
        if isinstance(record, dict) and isinstance(record.get("image"), str):
            found[Path(record["image"]).name] = record
    if not found:
        raise FileError(f"{path} holds no answer of synth --format jsonl")
    return found


def _answers(
    folder: Path, truths: Sequence[Truth], config: SearchConfig, jobs: int
) -> Iterable[tuple[dict[str, Any], float, float]]:
    """The records of the photos in order, each with CPU seconds and the process's peak memory in MB."""
    photos = [_photo(folder, truth.file) for truth in truths]
    if jobs == 1:
        yield from (_answer(photo, config) for photo in photos)
        return
    place = 0
    while place < len(photos):
        try:
            for answer in _side_by_side(photos[place:], config, jobs):
                yield answer
                place += 1
        except BrokenProcessPool:  # by which of those at work is not known, so that the first is tried alone
            yield _alone(photos[place], config)
            place += 1


def _side_by_side(
    photos: Sequence[Path], config: SearchConfig, jobs: int
) -> Iterable[tuple[dict[str, Any], float, float]]:
    # Spawned: torch and OpenCV do not survive a fork with their threads.
    with concurrent.futures.ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(_answer, photos, [config] * len(photos))


def _alone(photo: Path, config: SearchConfig) -> tuple[dict[str, Any], float, float]:
    """The record of a photo from a process of its own; one that the system ends is a record too."""
    try:
        return next(iter(_side_by_side([photo], config, 1)))
    except BrokenProcessPool:
        error = "the system ended the process for this photo, perhaps for want of memory"
        return {"image": photo.name, "program": None, "error": error}, 0.0, 0.0


def _photo(folder: Path, file: str) -> Path:
    """A photo's file: as the annotation names it, or in images/."""
    direct = folder / file
    return direct if os.path.isfile(direct) else folder / "images" / Path(file).name


def _answer(photo: Path, config: SearchConfig) -> tuple[dict[str, Any], float, float]:
    """Synthesize one photo; what goes wrong becomes a record too."""
    begun, used = time.perf_counter(), time.process_time()
    record: dict[str, Any] = {"image": photo.name, "program": None}
    try:
        image = read_image(photo)
        result = synthesize(image, config)
        if result.program is None:
            record["error"] = result.reason
        else:
            canvas = (image.size.width, image.size.height)
            header = Header(canvas=canvas, focal_mm=result.focal_mm, lens_k1=result.lens_k1)
            record["program"] = format_program(dataclasses.replace(result.program, header=header))
    except P3IError as failure:
        record["error"] = str(failure)
    except Exception as failure:  # a bug on one photo does not end the measurement of the others
        record["error"] = f"{type(failure).__name__}: {failure}"
    record["seconds"] = time.perf_counter() - begun
    return record, time.process_time() - used, _peak_mb()


def _peak_mb() -> float:
    """The most memory that this process held so far, in MB; 0 where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform != "darwin" else 2**20)
