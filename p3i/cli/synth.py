"""`p3i synth`: photos in, programs out."""

import dataclasses
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

import click

from p3i import api, files
from p3i.carried import read_program
from p3i.cli import grouped, options, progress, report, workers
from p3i.cli.batch import exit_code
from p3i.cli.inputs import INPUT, listed
from p3i.cli.photos import SUFFIXES, parse_roi
from p3i.cli.solving import Outcome, Task, failure, prepare, solve
from p3i.errors import P3IError, UsageError
from p3i.search.config import SearchConfig
from p3i.search.result import StopReason, SynthesisResult


@grouped.command("synth")
@click.argument("images", metavar="PHOTO...", type=INPUT, nargs=-1, required=True)
@grouped.group(
    "Output",
    click.option(
        "--format",
        "form",
        type=click.Choice(["p3p", "jsonl"]),
        default=None,
        help="Print a program, or one JSON object a line and photo. [default: by the name of -o, else p3p]",
    ),
    options.output("Where to write; - is stdout. Several photos need a folder, or --format jsonl."),
    options.force,
    options.of(SearchConfig, "top"),
    click.option(
        "--all",
        "every",
        is_flag=True,
        help="Find every pattern, one after another: FILE.p3p, FILE-2.p3p, ...; a line each in jsonl.",
    ),
    click.option("--trace", type=click.Path(), metavar="FILE", help="Write the search's steps, JSON lines."),
)
@grouped.group(
    "What to look for",
    options.of(SearchConfig, "structure", "extent", "object"),
    options.of(SearchConfig, "sketch", "start", sketch={"type": INPUT}, start={"type": INPUT}),
    options.of(SearchConfig, "strict"),
    click.option("--mask", type=INPUT, metavar="FILE", help="A picture whose white pixels are unknown."),
    click.option(
        "--roi",
        metavar="X,Y,W,H|POINTS",
        help="Look only here: a rectangle, or a polygon x,y x,y x,y ... in pixels.",
    ),
)
@grouped.group("The camera", options.of(SearchConfig, "focal_mm", "lens"))
@grouped.group(
    "The search",
    options.of(SearchConfig, "recipe", "exhaustive_s", "features", "weights", "time_s", "seed", "threads"),
    click.option(
        "--jobs", type=int, metavar="N", default=1, show_default=True, help="Photos to search at once."
    ),
    click.option(
        "--max-px", type=int, metavar="N", help="Take photos of up to N pixels (width times height)."
    ),
)
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Find the camera and the program of the pattern on each PHOTO.

    PHOTO is a file, a glob, a folder, @LIST (a text file of such names) or - (stdin).

    Prints the program of a single photo on stdout. Its `score` is how likely it is right: of answers that
    say 0.9, nine in ten are (structure, lattice, and tilt within 2 degrees). Exits with 5 where there is
    no regular pattern, and with 6 where only some of many photos have one. Ctrl-C prints the best program
    so far.
    """
    return run(Call.of(given))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """One call of `p3i synth`, with all that can be known before a photo is opened."""

    photos: tuple[Path, ...]
    config: SearchConfig
    as_jsonl: bool
    output: Path | None
    """The one file to write; None for stdout or a folder."""
    folder: Path | None
    """The folder to write programs into; None for a file or stdout."""
    force: bool
    mask: str | None
    roi: api.Polygon | None
    max_px: int | None
    jobs: int
    """How many processes share the photos."""
    trace: Path | None
    quiet: bool
    verbose: bool
    errors_as_json: bool
    every: bool = False
    """Whether every pattern of a photo is asked for, not the one worth most."""

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Call":
        """The call that the options of the command line mean; raises UsageError or FileError."""
        readers = {"sketch": api.load_sketch, "start": read_program}
        read = {name: None if given[name] is None else readers[name](given[name]) for name in readers}
        config = options.chosen(SearchConfig, given, **read)
        if given["every"]:
            config.check_for_all()
        photos = tuple(files.gather(listed(given["images"]), suffixes=SUFFIXES))
        output: str | None = given["output"]
        form = given["form"] or ("jsonl" if output and Path(output).suffix == ".jsonl" else "p3p")
        into_folder = output is not None and files.names_folder(output)
        if form == "jsonl" and into_folder:
            raise UsageError("--format jsonl writes one file or stdout, not a folder")
        if form == "p3p" and not into_folder and len(photos) > 1:
            raise UsageError(f"{len(photos)} photos need -o FOLDER/ or --format jsonl")
        if given["max_px"] is not None and given["max_px"] < 1:
            raise UsageError(f"--max-px must be at least 1, not {given['max_px']}")
        if given["jobs"] < 1:
            raise UsageError(f"--jobs must be at least 1, not {given['jobs']}")
        if given["jobs"] > 1 and "-" in (given["mask"], *map(str, photos)):
            raise UsageError("standard input is read by one process only: leave out --jobs")
        return cls(
            photos=photos,
            config=config,
            as_jsonl=form == "jsonl",
            output=Path(output) if output is not None and not into_folder else None,
            folder=Path(output) if output is not None and into_folder else None,
            force=given["force"],
            mask=given["mask"],
            roi=parse_roi(given["roi"]),
            max_px=given["max_px"],
            jobs=given["jobs"],
            trace=Path(given["trace"]) if given["trace"] else None,
            quiet=given["quiet"],
            verbose=given["verbose"] > 0,
            errors_as_json=given["error_format"] == "json",
            every=given["every"],
        )


def run(call: Call) -> int:
    """Work through the photos in order, write each answer as soon as it is known, return the exit code."""
    targets = _targets(call)
    _refuse_early(call, targets)
    codes: list[int] = []
    with ExitStack() as opened:
        lines = trace = None
        if call.as_jsonl and call.output is not None:
            lines = opened.enter_context(files.replacing(call.output, force=call.force))
        if call.trace is not None:
            trace = opened.enter_context(files.replacing(call.trace, force=call.force))
        tasks = [_task(call, photo, target) for photo, target in zip(call.photos, targets, strict=True)]
        answers = opened.enter_context(_answers(call, tasks, trace))
        for number, (task, target) in enumerate(zip(tasks, targets, strict=True)):
            name = task.photo.name
            label = name if len(tasks) == 1 else f"{number + 1}/{len(tasks)} {name}"
            try:
                with progress.bar(label, wanted=not call.quiet) as update:
                    outcome = answers(number, update)
                if outcome is None:
                    codes.append(130)
                    break
                codes.append(_finish(call, task, outcome, target=target, lines=lines))
            except KeyboardInterrupt:  # what was written before stays
                codes.append(130)
                break
    return exit_code(codes)


@contextmanager
def _answers(
    call: Call, tasks: Sequence[Task], trace: IO[str] | None
) -> Iterator[Callable[[int, api.Progress], Outcome | None]]:
    """What gives the outcome of each photo, by its number, one after another; None after an interrupt."""

    if call.jobs > 1 and len(tasks) > 1:
        told = not call.quiet and sys.stderr.isatty()
        with workers.pool(tasks, jobs=call.jobs, traced=trace is not None, told=told) as pool:

            def wait(number: int, update: api.Progress) -> Outcome | None:
                found = pool.answer(number, update)
                if found is None:
                    return None
                outcome, steps = found
                if trace is not None:
                    trace.writelines(steps)
                return outcome

            yield wait
        return
    with workers.held_back("SIGINT", "SIGTERM"):  # torch ends the process where its loading is cut short
        prepare()
    interrupted = False

    def work(number: int, update: api.Progress) -> Outcome | None:
        nonlocal interrupted
        if interrupted:
            return None
        outcome = solve(tasks[number], update=update, note=None if trace is None else trace.write)
        interrupted = outcome.code == 130
        return outcome

    yield work


def _task(call: Call, photo: Path, target: Path | None) -> Task:
    written_to = target or (call.output if call.as_jsonl else None)
    return Task(
        photo=photo,
        config=call.config,
        mask=call.mask,
        roi=call.roi,
        max_px=call.max_px,
        beside=written_to.parent if written_to else None,
        as_record=call.as_jsonl,
        every=call.every,
        raises_bugs=len(call.photos) == 1 and not call.as_jsonl,
    )


def _targets(call: Call) -> list[Path | None]:
    """The program file of each photo; None where the answer goes to stdout or into the one JSONL file."""
    if call.as_jsonl or call.folder is None:
        return [None if call.as_jsonl else call.output] * len(call.photos)
    stems = Counter(photo.stem for photo in call.photos)
    # a.jpg and a.png of one run would both become a.p3p.
    names = [photo.stem if stems[photo.stem] == 1 else photo.name for photo in call.photos]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise UsageError(f"two photos would both be written to {call.folder / twice[0]}.p3p")
    if call.every and (mixed := [name for name in names if _is_further(name, names)]):
        raise UsageError(
            f"{call.folder / mixed[0]}.p3p may be a photo's or a further pattern of another's: "
            "give them folders of their own, or --format jsonl"
        )
    return [call.folder / f"{name}.p3p" for name in names]


def _refuse_early(call: Call, targets: list[Path | None]) -> None:
    """Raise FileError for outputs that could not be written, before any photo is opened."""
    if call.folder is not None:
        files.make_folder(call.folder)
    wanted = [target for target in targets if target is not None]
    if call.config.top > 1:
        wanted += [_ranked(target, rank) for target in wanted for rank in range(2, call.config.top + 1)]
    wanted += [path for path in (call.output if call.as_jsonl else None, call.trace) if path is not None]
    for path in wanted:
        files.check_writable(path, force=call.force)


def _finish(call: Call, task: Task, outcome: Outcome, *, target: Path | None, lines: IO[str] | None) -> int:
    """Write and tell what came of a photo; returns its exit code.

    A file that cannot be written costs this photo only. The one file of JSON lines, and stdout, are all
    photos' and their errors are raised.
    """
    try:
        _write(call, outcome, target, lines=lines)
    except BrokenPipeError:
        raise
    except Exception as failed:
        if target is None or task.raises_bugs:
            raise
        known = isinstance(failed, P3IError)
        error = str(failed) if known else report.bug_sentence(failed)
        outcome = failure(task, error, code=failed.exit_code if known else 70)
    _talk(call, outcome)
    return outcome.code


def _write(call: Call, outcome: Outcome, target: Path | None, *, lines: IO[str] | None) -> None:
    """Write the answer where it belongs, at once."""
    if call.as_jsonl:
        text = "".join(json.dumps(record) + "\n" for record in outcome.records)
        if lines is None:
            click.echo(text, nl=False)
        else:
            lines.write(text)
            lines.flush()
    elif target is None and outcome.result is not None:
        text = "\n".join(_headed(call, outcome))
        click.echo(text.encode("utf-8"), nl=False)  # whatever the locale says
    elif target is not None:
        name = _further if call.every else _ranked
        ranks = range(1, len(outcome.texts) + 1)
        places = [target if rank == 1 else name(target, rank) for rank in ranks]
        for place in places:  # all or none
            files.check_writable(place, force=call.force)
        for place, text in zip(places, outcome.texts, strict=True):
            with files.replacing(place, force=call.force) as stream:
                stream.write(text)


def _headed(call: Call, outcome: Outcome) -> list[str]:
    """The texts of several candidates, or patterns, each under a comment that says which it is.

    A single one is left as it is.
    """
    texts, result = outcome.texts, outcome.result
    if len(texts) < 2 or result is None:
        return list(texts)
    if call.every:
        kind, told = "pattern", (result, *outcome.more)
        heads = [f"{one.structure}, score {one.score or 0.0:.2f}" for one in told]
    else:
        kind, heads = "candidate", [candidate.title for candidate in result.candidates]
    return [
        f"# {kind} {rank} of {len(texts)}: {head}\n{text}"
        for rank, (head, text) in enumerate(zip(heads, texts, strict=False), start=1)
    ]


def _talk(call: Call, outcome: Outcome) -> None:
    """Say on stderr what went wrong, what the search remarks and, with -v, what was found."""
    name, as_json = str(outcome.photo), call.errors_as_json
    if outcome.result is None:
        message = outcome.error if as_json or name in outcome.error else f"{name}: {outcome.error}"
        report.line(message, as_json=as_json, code=outcome.code, image=name)
        return
    if call.quiet:
        return
    results = (outcome.result, *outcome.more)
    for number, result in enumerate(results, start=1):
        which = f"pattern {number}: " if len(results) > 1 else ""
        remarks = list(result.notes)
        if result.stop is not StopReason.FOUND:
            remarks.append(f"{result.reason}; this is the best program so far")
        for remark in remarks:
            message = which + remark if as_json else f"{name}: {which}{remark}"
            report.line(message, as_json=as_json, kind="note", image=name)
        if call.verbose:
            message = f"{name}: {which}{_found(result)}, {outcome.seconds:.1f} s"
            report.line(message, as_json=as_json, kind="info", image=name)


def _found(result: SynthesisResult) -> str:
    """What was found, in a few words."""
    score = "" if result.score is None else f", score {result.score:.2f}"
    margin = "" if result.margin is None else f" (margin {result.margin:.2f})"
    focal = f"focal {result.focal_mm:.4g} mm, {result.focal_reason or result.focal_source}"
    return f"{result.structure} of {len(result.centers)} objects{score}{margin}, {focal}"


def _ranked(target: Path, rank: int) -> Path:
    """The file of a runner-up: a.p3p, a.2.p3p, a.3.p3p, ..."""
    return target.with_name(f"{target.stem}.{rank}{target.suffix}")


def _further(target: Path, number: int) -> Path:
    """The file of a photo's further pattern: a.p3p, a-2.p3p, a-3.p3p, ..."""
    return target.with_name(f"{target.stem}-{number}{target.suffix}")


def _is_further(name: str, names: Sequence[str]) -> bool:
    """Whether `name` is also what a further pattern of another of the `names` would be called."""
    stem, dash, number = name.rpartition("-")
    return bool(dash) and number.isdigit() and int(number) > 1 and stem in names
