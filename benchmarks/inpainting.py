"""How well hidden parts of photos come back: p3i's ways to fill beside four that others have, in one run.

python benchmarks/inpainting.py PHOTOS --out rows.jsonl      # an annotated set, as `p3i eval` takes it
python benchmarks/inpainting.py PHOTOS --methods stack telea --every 3 --seconds 600 --out rows.jsonl
python benchmarks/inpainting.py PHOTOS --scenes 12 --holes "side missing" --pictures strips --out rows.jsonl

What is hidden (filling/holes.py): on lattices 1, 2, 4 and 12 whole cells, boxes of 1.2 and 3 cells anywhere,
and boxes of 2 cells that lie by half over the pattern's edge or corner; on rings one object, two, a quarter
of the ring; on both, to be completed, a quarter to nearly half of the pattern's box: a side, a corner, a band
across. Places follow from the seed and the photo's name.

Only then, what is hidden being unknown, the program is searched for; holes that hide much have a search of
their own. Where it is not within tolerance of the annotation (the structure, a lattice's cell, half of a
ring's objects, the pose within 2 degrees where the annotation vouches for it) the hole is counted and left
out. Each method fills each hole, the others of the search in sight; with --together they stay hidden, and the
network's training is kept from one to the next. The measures are those of filling/measures.py; the report is
Markdown.

The journal (--out) has a line for each search and each fill, and a call that finds one there does not do it
again: it may be stopped and gone on with, and methods may be added. Fills of changed code belong into another
journal, which may begin with what `grep -e settings -e search` finds in this one, to spare the searches.
Needs pypatchmatch (extra `patchmatch`) for two of the methods.
"""

import argparse
import contextlib
import dataclasses
import json
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from filling.ground import Ground, grounds
from filling.holes import COMPLETIONS, KINDS, Hole, holes, in_groups
from filling.measures import judged
from filling.methods import METHODS, fills
from filling.sheets import write_sheet
from filling.tables import Row, report

import p3i
from p3i.errors import FileError, P3IError, UsageError
from p3i.evaluation.folds import Fold
from p3i.evaluation.measures import measure
from p3i.evaluation.scenes import annotation, scene
from p3i.evaluation.truth import Truth, read_truth, truth_of
from p3i.options.inpaint import InpaintOptions
from p3i.vision.image import Image

MOST_POSE_DEG = 2.0
LEAST_RING_F1 = 0.5
LEAST_KNOWN = 0.8
_SCENES = ("lattice", "circular")


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A photo of the set at `path`, or a rendered scene (then `path` is None): its annotation and truth."""

    name: str
    entry: Mapping[str, Any]
    truth: Truth
    path: Path | None
    seed: int

    def photo(self) -> Image:
        """The picture."""
        if self.path is not None:
            return p3i.read_image(self.path)
        return scene(self.truth.structure, self.seed).image()  # pyright: ignore[reportArgumentType]


class Journal:
    """Searches and rows of one run: in memory and, where there is a `path`, as JSON lines to go on from."""

    def __init__(self, path: Path | None, settings: Mapping[str, Any]) -> None:
        self.path, self.rows, self.searches = path, [], {}
        lines = _lines(path) if path is not None and path.exists() else []
        if any(line.get("settings", settings) != settings for line in lines):
            raise UsageError(f"{path} is of other settings than {json.dumps(settings)}: name another file")
        for line in lines:
            if "search" in line:
                self.searches[line["photo"], tuple(line["search"])] = line["program"]
            elif "method" in line:
                self.rows.append(Row(**line))
        if not any("settings" in line for line in lines):
            self._write({"settings": settings})

    def has(self, photo: str, hole: str, method: str) -> bool:
        """Whether the journal has a row of these."""
        return any((row.photo, row.hole, row.method) == (photo, hole, method) for row in self.rows)

    def add_search(self, photo: str, kinds: tuple[str, ...], program: str | None) -> None:
        """Note the program found with holes of these kinds hidden; None where it is not within tolerance."""
        self.searches[photo, kinds] = program
        self._write({"photo": photo, "search": kinds, "program": program})

    def add_row(self, row: Row) -> None:
        """Note a fill."""
        self.rows.append(row)
        self._write(dataclasses.asdict(row))

    def _write(self, line: Mapping[str, Any]) -> None:
        if self.path is not None:
            with self.path.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(line) + "\n")


def _lines(path: Path) -> list[dict[str, Any]]:
    """The whole lines of a journal; a last one that a kill cut short is passed over, and ended.

    Raises FileError for a file that is something else.
    """
    found, text = [], path.read_text(encoding="utf-8", errors="replace")
    for line in text.splitlines():
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    known = all(isinstance(line, dict) and line.keys() & {"settings", "photo"} for line in found)
    if text.strip() and not (found and known):
        raise FileError(f"{path} is no journal of this benchmark")
    if text and not text.endswith("\n"):
        with path.open("a", encoding="utf-8") as stream:
            stream.write("\n")
    return found


def cases(given: argparse.Namespace) -> Iterator[Case]:
    """The photos asked for, then the rendered scenes, half of them lattices and half rings."""
    if given.photos is not None:
        truths = read_truth(given.photos)
        entries = json.loads((given.photos / "annotations.json").read_text(encoding="utf-8"))
        known = dict(zip((truth.file for truth in truths), entries, strict=True))
        chosen = truths if given.fold is None else Fold.parse(given.fold).of(truths)
        chosen = [one for one in chosen if given.only is None or given.only in one.file]
        chosen = chosen[:: given.every][: given.limit]
        # In an order of chance, so that a run which is stopped early has seen photos of all kinds.
        for place in np.random.default_rng(given.seed).permutation(len(chosen)):
            truth = chosen[place]
            yield Case(truth.file, known[truth.file], truth, given.photos / truth.file, given.seed)
    for number in range(given.scenes):
        structure, seed = _SCENES[number % 2], given.seed + number // 2
        name = f"{structure} scene {seed}"
        entry = annotation(scene(structure, seed), name)
        yield Case(name, entry, truth_of(entry), None, seed)


def cut(case: Case, photo: Image, kinds: Sequence[str], seed: int) -> tuple[list[Hole], tuple[Ground, ...]]:
    """The holes of these kinds in a photo, and its pattern's ground."""
    parts = grounds(case.entry, case.truth)
    if not parts:
        return [], ()
    # By the photo's name, so that the same holes are cut whichever photos are asked for beside it.
    random = np.random.default_rng([seed, *case.name.encode()])
    found = []
    for hole in holes(parts, random):
        known = hole.mask & photo.valid
        # Some photos are transparent in places; a large part of one is taken without them.
        least = LEAST_KNOWN if hole.kind in COMPLETIONS else 1
        if hole.kind in kinds and known.sum() >= least * hole.mask.sum():
            found.append(Hole(hole.kind, known))
    return found, parts


def searched(case: Case, photo: Image, hidden: Sequence[Hole]) -> str | None:
    """The program found with these holes unknown, as text; None where none is within tolerance."""
    found = p3i.synth(photo, mask=np.any([hole.mask for hole in hidden], axis=0)).program
    if found is None:
        return None
    off = measure(found, case.truth)
    if case.truth.pose_reliable and off.pose_deg > MOST_POSE_DEG:
        return None
    ring_missed = case.truth.structure != "lattice" and off.f1_free < LEAST_RING_F1
    return None if not off.structure_ok or off.lattice_ok is False or ring_missed else p3i.dumps(found)


def fill_all(case: Case, journal: Journal, given: argparse.Namespace) -> None:
    """Search beside the holes of a photo and fill them, as far as the journal has it not."""
    photo = case.photo()
    found, parts = cut(case, photo, given.holes, given.seed)
    if not found:
        return
    pattern = np.any([part.mask() for part in parts], axis=0)
    for group in in_groups(found, np.concatenate([part.centers() for part in parts])):
        kinds = tuple(hole.kind for hole in group)
        if (case.name, kinds) not in journal.searches:
            journal.add_search(case.name, kinds, searched(case, photo, group))
        text = journal.searches[case.name, kinds]
        told = "none within tolerance" if text is None else "a program"
        print(f"{case.name:36s} {', '.join(kinds)}: {told}", flush=True)
        if text is not None:
            fill_group(case, photo, pattern, group, p3i.loads(text), journal, given)


def fill_group(
    case: Case,
    photo: Image,
    pattern: np.ndarray,
    group: Sequence[Hole],
    program: p3i.Program,
    journal: Journal,
    given: argparse.Namespace,
) -> None:
    """Fill the holes of one search by every method that the journal has not; `pattern` bool [H, W]."""
    truth, every = np.rint(photo.pixels.clip(0, 1) * 255), np.any([hole.mask for hole in group], axis=0)
    begun: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        options = network_options(given) | ({"checkpoint": Path(folder) / "npn"} if given.together else {})
        ways = fills(given.methods, options)
        for hole in group:
            hidden = every if given.together else hole.mask
            seen = dataclasses.replace(
                photo,
                pixels=np.where(hidden[:, :, None], np.float32(0), photo.pixels),
                valid=photo.valid & ~hidden if given.together else photo.valid,
            )
            shown: dict[str, np.ndarray] = {}
            for method, fill in ways.items():
                known = journal.has(case.name, hole.kind, method)
                if known and given.pictures is None:
                    continue
                started = time.process_time()
                filled = fill(seen, program, hole.mask)
                spent = time.process_time() - started
                shown[method] = np.rint(filled.clip(0, 1) * 255)
                if known:
                    continue
                off = judged(truth, shown[method], hole.mask, pattern=pattern, known=photo.valid)
                row = Row(
                    photo=case.name,
                    drawn=case.path is None,
                    hole=hole.kind,
                    method=method,
                    pixels=int(hole.mask.sum()),
                    **dataclasses.asdict(off),
                    cpu_s=spent,
                    first=method not in begun,
                )
                begun.add(method)
                journal.add_row(row)
                told = f"L1 {row.l1:6.2f}  sharp {row.sharp:5.2f}  seam {row.seam:5.2f} {spent:6.1f} s"
                print(f"{case.name:36s} {hole.kind:15s} {method:16s} {told}", flush=True)
            if given.pictures is not None:
                stem = f"{Path(case.name).stem}-{hole.kind}".replace(" ", "_")
                write_sheet(given.pictures / f"{stem}.png", truth, hole.mask, shown)


def network_options(given: argparse.Namespace) -> dict[str, Any]:
    """The fields of InpaintOptions that the arguments set. Raises UsageError for a value out of range."""
    options = {} if given.steps is None else {"steps": given.steps}
    InpaintOptions(method="npn", **options)
    return options


def parsed() -> argparse.Namespace:
    """The arguments; ends the process for wrong ones."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", type=Path, nargs="?", help="an annotated set")
    parser.add_argument("--scenes", type=int, default=0, metavar="N", help="after it, N rendered scenes")
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=list(METHODS))
    parser.add_argument(
        "--holes", nargs="+", choices=KINDS, default=list(KINDS), help="only holes of these kinds"
    )
    parser.add_argument("--no-completions", action="store_true", help="none of the large parts")
    parser.add_argument("--only", metavar="TEXT", help="only photos whose name contains this")
    parser.add_argument("--fold", metavar="K/N", help="part K of N of the set, as of p3i eval")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="take every Nth photo")
    parser.add_argument("--photos", dest="limit", type=int, metavar="N", help="take N photos at most")
    parser.add_argument("--seconds", type=float, help="begin no further photo after so much CPU time")
    parser.add_argument("--steps", type=int, metavar="N", help="steps of training of npn, not its default")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, metavar="FILE", help="the journal, JSON lines")
    parser.add_argument(
        "--pictures", type=Path, metavar="DIR", help="write a strip for each hole, to look at"
    )
    parser.add_argument("--together", action="store_true", help="all holes of a search hidden from its fills")
    parser.add_argument("--report", action="store_true", help="only report what the journal has")
    given = parser.parse_args()
    if given.photos is None and not given.scenes and not given.report:
        parser.error("name an annotated set, or ask for --scenes")
    if given.report and (given.out is None or not given.out.exists()):
        parser.error("--report needs the journal (--out)")
    if given.every < 1 or given.scenes < 0 or given.seed < 0 or (given.limit is not None and given.limit < 1):
        parser.error("--every and --photos are at least 1, --scenes and --seed at least 0")
    if given.no_completions:
        given.holes = [kind for kind in given.holes if kind not in COMPLETIONS]
    return given


def main() -> None:
    """Measure, print a line a fill and the report."""
    given = parsed()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    try:
        measured(given)
    except (P3IError, OSError) as error:
        raise SystemExit(f"error: {error}") from None


def measured(given: argparse.Namespace) -> None:
    """Fill what the journal has not, and print the report on all of it. Raises P3IError for wrong input."""
    network_options(given)
    settings = {"seed": given.seed, "steps": given.steps} | ({"together": True} if given.together else {})
    journal, begun = Journal(given.out, settings), time.process_time()
    for case in () if given.report else cases(given):
        if given.seconds is not None and time.process_time() - begun > given.seconds:
            break
        fill_all(case, journal, given)
    if not (journal.searches or given.report):
        raise UsageError("no hole was cut: no photo has such a name, or none has room for such a hole")
    missed = sum(len(kinds) for (_, kinds), program in journal.searches.items() if program is None)
    asked = sum(len(kinds) for _, kinds in journal.searches)
    pictures = len({photo for photo, _ in journal.searches})
    print(
        f"\n{pictures} pictures with {asked} holes in {len(journal.searches)} searches; beside {missed} "
        f"of them no program within tolerance is found\n\n{report(journal.rows, METHODS)}"
    )


if __name__ == "__main__":
    main()
