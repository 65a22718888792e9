"""Searching and measuring: `synth`, `synth_all`, `score`, `trace`, `eval_set`, `examples`; photos read."""

import dataclasses
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from p3i import files
from p3i.api.refusal import refuses_unknown
from p3i.carried import read_program
from p3i.errors import NoPatternError, UsageError
from p3i.grammar.ast import Header, Program
from p3i.language import load_sketch
from p3i.records import changed
from p3i.search.config import SearchConfig
from p3i.search.result import Candidate, SynthesisResult

if TYPE_CHECKING:
    import numpy as np

    from p3i.evaluation.score_set import SetScore
    from p3i.paint.draw.film import Film
    from p3i.search.judge.evaluate import Evaluation
    from p3i.size import Size
    from p3i.vision.image import Image

Polygon = tuple[tuple[float, float], ...]
Progress = Callable[[str, float], None]
Trace = Callable[[Mapping[str, Any]], None]

_MANY_ABSENT = 1 / 3
"""Where more than this share of the objects is not there, the result says so."""


@refuses_unknown
def read_image(path: str | os.PathLike[str], *, max_px: int | None = None) -> "Image":
    """The photo at `path`, upright, RGB in 0..1, with its mask of known pixels and its focal.

    `max_px` bounds width times height. Raises FileError with a sentence for what cannot be read.
    """
    from p3i.vision.image import read_image as read

    return read(path) if max_px is None else read(path, max_px=max_px)


def synth(
    photo: "str | os.PathLike[str] | Image",
    config: SearchConfig | None = None,
    *,
    mask: "str | os.PathLike[str] | np.ndarray | None" = None,
    roi: Polygon | None = None,
    max_px: int | None = None,
    beside: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    trace: Trace | None = None,
    **options: Any,
) -> SynthesisResult:
    """Find the camera and the program of the pattern on `photo`.

    `options` are fields of SearchConfig and change `config`: `synth("a.jpg", seed=1, time_s=5)`; `sketch`
    and `start` may be paths of files. What is
    white in the picture `mask`, or True in the array `mask` [H, W], and what lies outside the polygon `roi`
    ((x, y) in pixels) is unknown: never evidence. `max_px` bounds width times height of a photo that is
    read here. The header of the program names the photo relative to the folder `beside` (default: the
    working folder), and holds the canvas, the focal and the facts of the fit, but no times.

    Returns a result whose `program` is None, with a `stop` reason, where no pattern convinces. Raises
    UsageError for options that cannot be, FileError for a photo or mask that cannot be read.
    """
    asked = _asked(config, options, verb="synth")
    from p3i.search.synthesize import synthesize

    image = read_image(photo, max_px=max_px) if isinstance(photo, str | os.PathLike) else photo
    seen = without(image, mask=mask, roi=roi)
    result = synthesize(seen, asked, progress=progress, trace=trace)
    return _told(result, photo, image, seen, beside=beside)


def synth_all(
    photo: "str | os.PathLike[str] | Image",
    config: SearchConfig | None = None,
    *,
    mask: "str | os.PathLike[str] | np.ndarray | None" = None,
    roi: Polygon | None = None,
    max_px: int | None = None,
    beside: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
    trace: Trace | None = None,
    **options: Any,
) -> tuple[SynthesisResult, ...]:
    """Find every pattern on `photo`: the results of `synth` for one after another, what the earlier ones
    explain made unknown. The first is the answer of `synth`; where that is a refusal, it is the only one.

    Everything else is as in `synth`; `time_s` is for all together. Raises UsageError, too, for a sketch, a
    start or the paper's recipe, and for more than one candidate, which all speak of one pattern. `mask` as
    array is bool [H, W].
    """
    asked = _asked(config, options, verb="synth_all")
    asked.check_for_all()
    from p3i.search.several import all_patterns
    from p3i.search.synthesize import synthesize

    image = read_image(photo, max_px=max_px) if isinstance(photo, str | os.PathLike) else photo
    known = without(image, mask=mask, roi=roi)
    results = all_patterns(
        known,
        asked,
        lambda seen, left: synthesize(seen, left, progress=progress, trace=trace),
    )
    return tuple(_told(result, photo, image, known, beside=beside) for result in results)


def _asked(config: SearchConfig | None, options: dict[str, Any], *, verb: str) -> SearchConfig:
    """`config` changed by `options`, whose sketch and start may be paths."""
    for name, reader in (("sketch", load_sketch), ("start", read_program)):
        if isinstance(options.get(name), str | os.PathLike):
            options[name] = reader(options[name])
    return changed(config or SearchConfig(), options, verb=verb)


def _told(
    result: SynthesisResult,
    photo: "str | os.PathLike[str] | Image",
    image: "Image",
    seen: "Image",
    *,
    beside: str | os.PathLike[str] | None,
) -> SynthesisResult:
    """A result with what the reading of its photo remarked, with headers, and with what is absent of it.

    `seen` is the photo as it was searched.
    """
    name = _relative(photo, Path(beside or ".")) if isinstance(photo, str | os.PathLike) else None
    heard = tuple(note for note in image.notes if note not in result.notes)
    result = dataclasses.replace(result, notes=heard + result.notes)
    return _with_absent(_with_headers(result, size=image.size, name=name), seen)


def score(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    config: SearchConfig | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> "Evaluation":
    """How well `program` explains `photo`: equation 2 as printed in the paper, and how far its objects agree.

    Without a program it is the one that `synth` finds. `options` change `config` as in `synth`. Raises
    UsageError for options that cannot be, FileError or ParseError where photo or program cannot be read,
    NoPatternError for a photo without a pattern.
    """
    asked = changed(config or SearchConfig(), options, verb="score")
    from p3i.search.judge.evaluate import evaluate

    image, given = photo_and_program(photo, program, asked, progress=progress)
    return evaluate(image, given, asked)


def photo_and_program(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None,
    config: SearchConfig | None = None,
    *,
    progress: Progress | None = None,
) -> "tuple[Image, Program]":
    """Both in memory: read where they are files, the program found by `synth` where there is none.

    Raises NoPatternError where none is found, FileError and ParseError for files that cannot be read.
    """
    # The program first: it is soon known to be wrong.
    given = program if isinstance(program, Program | None) else read_program(program)
    image = read_image(photo) if isinstance(photo, str | os.PathLike) else photo
    if given is not None:
        return doubted(image, given, photo), given
    result = synth(image, config, progress=progress)
    if result.program is None:
        raise NoPatternError(f"{result.reason}; give a program, or try `p3i synth -v` to see more")
    return image, result.program


def doubted(image: "Image", program: Program, photo: "str | os.PathLike[str] | Image") -> "Image":
    """`image`, which was read from `photo`, with a note where `program` was made for another one."""
    from p3i.place.belongs import doubt

    name = os.fspath(photo) if isinstance(photo, str | os.PathLike) else "-"
    sentence = doubt(program, image.size, None if name == "-" else files.as_text(name))
    return image if sentence is None else dataclasses.replace(image, notes=(sentence, *image.notes))


@refuses_unknown
def trace(trace: str | os.PathLike[str], *, image: str | os.PathLike[str] | None = None) -> "Film":
    """The search that `p3i synth --trace` wrote down, as pictures over its photo.

    `image` is the photo where the trace's own name of it does not lead there, or picks one search of several.
    The result has `frames`, `notes` and `encode(kind)`. Raises FileError (with the line) and UsageError.
    """
    from p3i.paint.draw.film import film_of

    return film_of(files.named(trace), image=None if image is None else os.fspath(image))


def eval_set(
    folder: str | os.PathLike[str],
    config: SearchConfig | None = None,
    *,
    results: str | os.PathLike[str] | None = None,
    jobs: int = 1,
    only: str | None = None,
    limit: int | None = None,
    fold: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> "SetScore":
    """Measure the search on the annotated set in `folder` (docs/evaluation.md).

    `options` change `config` as in `synth`. With `results`, a file of the JSON lines that `synth` printed,
    nothing is searched. `fold`, "1/2" or "2/2", takes one half of the set. `jobs` is the number of processes.
    Raises FileError and UsageError.
    """
    asked = changed(config or SearchConfig(), options, verb="eval_set")
    from p3i.evaluation.score_set import score_set

    return score_set(
        files.named(folder),
        asked,
        results=None if results is None else files.named(results),
        jobs=jobs,
        only=only,
        limit=limit,
        fold=fold,
        progress=progress,
    )


@refuses_unknown
def examples(
    folder: str | os.PathLike[str],
    *,
    seed: int = 0,
    lattices: int = 4,
    rings: int = 4,
    hybrids: int = 4,
    focals: bool = False,
    force: bool = False,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Draw scenes with known truth into `folder`: images/, programs/ and annotations.json (docs/examples.md).

    Returns the paths of the pictures. The same arguments write the same bytes. `focals` gives a third of the
    rings another lens than 35 mm. Raises UsageError for counts out of range, FileError where a file of the
    set exists already (without `force`) or cannot be written.
    """
    from p3i.evaluation.example_set import write_examples

    return write_examples(
        files.named(folder),
        {"lattice": lattices, "circular": rings, "hybrid": hybrids},
        seed=seed,
        focals=focals,
        force=force,
        progress=progress,
    )


def without(
    image: "Image", *, mask: "str | os.PathLike[str] | np.ndarray | None", roi: Polygon | None
) -> "Image":
    """`image` with what `mask` (bool [H, W], or a file) marks made unknown, looked at in `roi` only."""
    if mask is None and roi is None:
        return image
    import cv2
    import numpy as np

    from p3i.vision.image import masked, read_mask, within

    if isinstance(mask, str | os.PathLike):
        image = masked(image, read_mask(mask, image.size))
    elif mask is not None:
        if mask.shape != image.valid.shape or mask.dtype != np.bool_:
            raise UsageError(f"a mask is bool {image.valid.shape}, not {mask.dtype} {mask.shape}")
        image = masked(image, mask)
    if roi is not None:
        if len(roi) < 3 or not all(math.isfinite(value) for point in roi for value in point):
            raise UsageError("a region of interest is a polygon of three points or more")
        inside = np.zeros(image.valid.shape, np.uint8)
        # OpenCV counts in whole numbers; beyond a picture's largest side a corner's place is all the same.
        corners = np.clip(np.round(np.array(roi)), -(2**20), 2**20).astype(np.int32)
        cv2.fillPoly(inside, [corners], 1)
        image = within(image, inside == 1) if inside.any() else masked(image, inside == 0)
    if not image.valid.any():
        raise UsageError("mask and region of interest leave nothing of the photo")
    return image


def _relative(photo: str | os.PathLike[str], folder: Path) -> str | None:
    """The photo's path as seen from `folder`, with slashes; None for standard input.

    Absolute only where no relative path exists, None too where its bytes are no text, or
    the working folder is gone.
    """
    if os.fspath(photo) == "-":
        return None
    try:
        name = Path(os.path.relpath(photo, folder)).as_posix()
    except ValueError:  # another drive of Windows
        name = Path(photo).absolute().as_posix()
    except OSError:  # the working folder is gone
        return None
    return name if name.isprintable() else None


def _with_absent(result: SynthesisResult, photo: "Image") -> SynthesisResult:
    """`result` with the number of its objects that `photo` does not show, and a note where they are many."""
    if result.program is None:
        return result
    from p3i.place.presence import absent_of

    absent, count = absent_of(result.program, photo, focal_mm=result.focal_mm)
    notes = result.notes
    if absent > _MANY_ABSENT * count:
        notes = (*notes, f"{absent} of {count} objects are not there on the photo; p3i show marks them")
    return dataclasses.replace(result, absent=absent, notes=notes)


def _with_headers(result: SynthesisResult, *, size: "Size", name: str | None) -> SynthesisResult:
    """`result` with the header of DESIGN 2.5 on each of its programs."""

    def titled(answer: SynthesisResult | Candidate, program: Program, margin: float | None) -> Program:
        facts: dict[str, str | int | float] = {
            "structure": answer.structure or "lattice",
            "score": round(answer.score or 0.0, 4),
        }
        if margin is not None:
            facts["margin"] = round(margin, 4)
        facts |= {"features": result.features, "focal_from": answer.focal_source, "seed": result.seed}
        if answer.upright:
            facts["upright"] = True
        if result.window is not None:
            facts["window"] = ",".join(map(str, result.window))
        header = Header(
            canvas=(size.width, size.height),
            focal_mm=answer.focal_mm,
            lens_k1=result.lens_k1,
            image=name,
            fit=tuple(facts.items()),
        )
        return dataclasses.replace(program, header=header)

    candidates = tuple(
        dataclasses.replace(candidate, program=titled(candidate, candidate.program, None))
        for candidate in result.candidates
    )
    if result.program is None:
        return dataclasses.replace(result, candidates=candidates)
    program = titled(result, result.program, result.margin)
    return dataclasses.replace(result, program=program, candidates=candidates)
