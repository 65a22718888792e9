"""`p3i synth`: photos in, programs out."""

import dataclasses
import json
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal

import click

from p3i import api, files
from p3i.carried import read_program
from p3i.cli import options, progress, report, search_options
from p3i.cli.batch import exit_code
from p3i.cli.inputs import INPUT, listed
from p3i.cli.photos import SUFFIXES, parse_roi
from p3i.errors import NoPatternError, P3IError, UsageError
from p3i.records import told
from p3i.search.config import EXTENTS, RECIPES, STRUCTURES, SearchConfig
from p3i.search.result import Candidate, StopReason, SynthesisResult

sentence, default = told(SearchConfig)


class NumberOrWord(click.ParamType):
    """A number that is `what`, or one of the words, each of which means a value."""

    def __init__(self, unit: str, what: str, words: Mapping[str, str | None]) -> None:
        self.name = "|".join((unit, *words))
        self.what, self.words = what, words

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float | str | None:
        word = str(value).strip().lower()
        if word in self.words:
            return self.words[word]
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is neither {self.what} nor {' nor '.join(self.words)}", param, ctx)


FOCAL = NumberOrWord("MM", "a focal length in mm", {"auto": "auto"})
LENS = NumberOrWord("K1", "a radial distortion", {"auto": "auto", "none": None})


@click.command("synth", short_help="Find the camera and the program of a photo's pattern.")
@click.argument("images", metavar="PHOTO...", type=INPUT, nargs=-1, required=True)
@click.option(
    "--format",
    "form",
    type=click.Choice(["p3p", "jsonl"]),
    default=None,
    help="Print a program, or one JSON object a line and photo. [default: by the name of -o, else p3p]",
)
@options.output("Where to write; - is stdout. Several photos need a folder, or --format jsonl.")
@options.force
@options.field(SearchConfig, "structure", metavar="|".join(STRUCTURES))
@options.field(SearchConfig, "extent", type=click.Choice(EXTENTS))
@click.option("--sketch", type=INPUT, metavar="FILE", help=sentence("sketch"))
@click.option("--start", type=INPUT, metavar="FILE", help=sentence("start"))
@options.field(SearchConfig, "recipe", type=click.Choice(RECIPES))
@click.option("--exhaustive", "exhaustive_s", type=float, metavar="SECONDS", help=sentence("exhaustive_s"))
@click.option("--mask", type=INPUT, metavar="FILE", help="A picture whose white pixels are unknown.")
@click.option(
    "--roi",
    metavar="X,Y,W,H|POINTS",
    help="Look only here: a rectangle, or a polygon x,y x,y x,y ... in pixels.",
)
@click.option("--focal", "focal_mm", type=FOCAL, metavar=FOCAL.name, help=sentence("focal_mm"))
@click.option("--lens", type=LENS, metavar=LENS.name, help=sentence("lens"))
@search_options.features
@search_options.weights
@click.option("--strict", is_flag=True, help=sentence("strict"))
@click.option("--time", "time_s", type=float, metavar="SECONDS", help=sentence("time_s"))
@options.field(SearchConfig, "top", type=int, metavar="K")
@options.field(SearchConfig, "seed", type=int)
@search_options.device
@search_options.threads
@click.option("--max-px", type=int, metavar="N", help="Take photos of up to N pixels (width times height).")
@click.option("--trace", type=click.Path(), metavar="FILE", help="Write the search's steps, JSON lines.")
@options.quiet
@options.verbose
@options.error_format
def command(**given: Any) -> int:
    """Find the camera and the program of the pattern on each PHOTO: a file, a glob, a folder, or @LIST.

    Prints the program of a single photo on stdout. Exits with 5 where there is no regular pattern, and
    with 6 where only some of many photos have one. Ctrl-C prints the best program so far.
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
    trace: Path | None
    quiet: bool
    verbose: bool
    errors_as_json: bool

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Call":
        """The call that the options of the command line mean; raises UsageError or FileError."""
        names = {field.name for field in dataclasses.fields(SearchConfig)}
        chosen = {name: value for name, value in given.items() if name in names}
        if chosen["weights"] is not None:
            chosen["weights"] = Path(chosen["weights"])
        for name, reader in (("sketch", api.load_sketch), ("start", read_program)):
            if chosen[name] is not None:
                chosen[name] = reader(chosen[name])
        config = SearchConfig(**chosen)
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
            trace=Path(given["trace"]) if given["trace"] else None,
            quiet=given["quiet"],
            verbose=given["verbose"] > 0,
            errors_as_json=given["error_format"] == "json",
        )


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What came of one photo: a result with its time, or an error with its exit code."""

    photo: Path
    result: SynthesisResult | None = None
    error: str = ""
    code: int = 0
    seconds: float = 0.0


def run(call: Call) -> int:
    """Work through the photos in order, write each answer as soon as it is known, return the exit code."""
    targets = _targets(call)
    _refuse_early(call, targets)
    import p3i.search.synthesize  # noqa: F401  # torch loads before the first photo's clock starts

    codes: list[int] = []
    with ExitStack() as open_files:
        lines = trace = None
        if call.as_jsonl and call.output is not None:
            lines = open_files.enter_context(files.replacing(call.output, force=call.force))
        if call.trace is not None:
            trace = open_files.enter_context(files.replacing(call.trace, force=call.force))
        for number, (photo, target) in enumerate(zip(call.photos, targets, strict=True)):
            label = photo.name if len(call.photos) == 1 else f"{number + 1}/{len(call.photos)} {photo.name}"
            with progress.bar(label, wanted=not call.quiet) as update:
                outcome = _solve(call, photo, target, update=update, trace=trace)
            _write(call, outcome, target, lines=lines)
            _talk(call, outcome)
            codes.append(outcome.code)
            if outcome.code == 130:
                break
    return exit_code(codes)


def _targets(call: Call) -> list[Path | None]:
    """The program file of each photo; None where the answer goes to stdout or into the one JSONL file."""
    if call.as_jsonl or call.folder is None:
        return [None if call.as_jsonl else call.output] * len(call.photos)
    stems = Counter(photo.stem for photo in call.photos)
    # a.jpg and a.png of one run would both become a.p3p.
    names = [photo.stem if stems[photo.stem] == 1 else photo.name for photo in call.photos]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise UsageError(f"two photos would both be written to {call.folder / twice[0]}.p3p")
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


def _solve(call: Call, photo: Path, target: Path | None, *, update: api.Progress, trace: Any) -> Outcome:
    """Synthesize one photo; every failure but a closed pipe becomes an Outcome, so a batch goes on."""

    def note(step: Mapping[str, Any]) -> None:
        trace.write(json.dumps({"image": str(photo), **step}, default=_plain) + "\n")

    written_to = target or (call.output if call.as_jsonl else None)
    begun = time.perf_counter()
    try:
        result = api.synth(
            photo,
            call.config,
            mask=call.mask,
            roi=call.roi,
            max_px=call.max_px,
            beside=written_to.parent if written_to else None,
            progress=update,
            trace=note if trace is not None else None,
        )
    except KeyboardInterrupt:
        error, code = StopReason.INTERRUPTED.value, 130
    except BrokenPipeError:
        raise
    except P3IError as failure:
        error, code = str(failure), failure.exit_code
    except MemoryError:
        error, code = "not enough memory for this photo; scale it down", 3
    except Exception as failure:
        if len(call.photos) == 1 and not call.as_jsonl:
            raise
        error, code = report.bug_sentence(failure), 70
    else:
        seconds = time.perf_counter() - begun
        code = 130 if result.stop is StopReason.INTERRUPTED else 0
        if result.program is None:
            error, code = result.reason, code or NoPatternError.exit_code
            return Outcome(photo=photo, error=error, code=code, seconds=seconds)
        return Outcome(photo=photo, result=result, code=code, seconds=seconds)
    return Outcome(photo=photo, error=error, code=code, seconds=time.perf_counter() - begun)


def _write(call: Call, outcome: Outcome, target: Path | None, *, lines: Any) -> None:
    """Write the answer where it belongs, at once."""
    if call.as_jsonl:
        text = json.dumps(_record(outcome))
        if lines is None:
            click.echo(text)
        else:
            lines.write(text + "\n")
            lines.flush()
        return
    if outcome.result is None or outcome.result.program is None:
        return
    from p3i.grammar.printer import format_program

    layout = "table1" if call.config.strict else "python"
    best = format_program(outcome.result.program, layout=layout)
    if target is None:
        several = outcome.result.candidates if call.config.top > 1 else ()
        text = best if len(several) < 2 else _one_after_another(several, layout=layout)
        click.echo(text.encode("utf-8"), nl=False)  # whatever the locale says
        return
    with files.replacing(target, force=call.force) as stream:
        stream.write(best)
    for rank, candidate in enumerate(outcome.result.candidates[1 : call.config.top], start=2):
        with files.replacing(_ranked(target, rank), force=call.force) as stream:
            stream.write(format_program(candidate.program, layout=layout))


def _one_after_another(candidates: Sequence[Candidate], *, layout: Literal["python", "table1"]) -> str:
    """The programs of several candidates, each under a comment that says which it is."""
    from p3i.grammar.printer import format_program

    texts = []
    for rank, candidate in enumerate(candidates, start=1):
        what = f"{candidate.structure}, score {candidate.score:.4f}"
        text = format_program(candidate.program, layout=layout)
        texts.append(f"# candidate {rank} of {len(candidates)}: {what}\n{text}")
    return "\n".join(texts)


def _record(outcome: Outcome) -> dict[str, Any]:
    from p3i.search.record import answer_record, failure_record

    name = str(outcome.photo)
    if outcome.result is None:
        return failure_record(image=name, error=outcome.error, code=outcome.code, seconds=outcome.seconds)
    return answer_record(outcome.result, image=name, seconds=outcome.seconds)


def _talk(call: Call, outcome: Outcome) -> None:
    """Say on stderr what went wrong, what the search remarks and, with -v, what was found."""
    name, as_json = str(outcome.photo), call.errors_as_json
    if outcome.result is None:
        message = outcome.error if as_json or name in outcome.error else f"{name}: {outcome.error}"
        report.line(message, as_json=as_json, code=outcome.code, image=name)
        return
    result = outcome.result
    if call.quiet:
        return
    remarks = list(result.notes)
    if result.stop is not StopReason.FOUND:
        remarks.append(f"{result.reason}; this is the best program so far")
    for remark in remarks:
        message = remark if as_json else f"{name}: {remark}"
        report.line(message, as_json=as_json, kind="note", image=name)
    if call.verbose:
        score = "" if result.score is None else f", score {result.score:.2f}"
        margin = "" if result.margin is None else f" (margin {result.margin:.2f})"
        focal = f"focal {result.focal_mm:.4g} mm, {result.focal_reason or result.focal_source}"
        found = f"{result.structure} of {len(result.centers)} objects{score}{margin}, {focal}"
        message = f"{name}: {found}, {outcome.seconds:.1f} s"
        report.line(message, as_json=as_json, kind="info", image=name)


def _ranked(target: Path, rank: int) -> Path:
    """The file of a runner-up: a.p3p, a.2.p3p, a.3.p3p, ..."""
    return target.with_name(f"{target.stem}.{rank}{target.suffix}")


def _plain(value: Any) -> Any:
    """What json cannot write, as it can: arrays and tensors as lists, the rest as text."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
