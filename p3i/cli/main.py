"""`p3i`: the table of commands, and the one place where an error becomes a line and an exit code.

Commands are imported when they are called, so `p3i --help` and `p3i check` start without torch.
"""

import difflib
import importlib
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import click

from p3i.cli import report, streams
from p3i.errors import P3IError

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem


class Entry(NamedTuple):
    """A line of the command table: the module that holds `command`, and what `p3i --help` says of it."""

    module: str
    summary: str


COMMANDS: dict[str, Entry] = {
    "synth": Entry("p3i.cli.synth", "Find the camera and the program of a photo's pattern."),
    "show": Entry("p3i.cli.show", "Draw a program over its photo, to see whether it is right."),
    "render": Entry("p3i.cli.render", "Draw a program as PNG, SVG or PDF, also over its photo."),
    "rectify": Entry("p3i.cli.rectify", "Straighten a photo by its program."),
    "tile": Entry("p3i.cli.tile", "Make a seamless texture of a photo's pattern."),
    "inpaint": Entry("p3i.cli.inpaint", "Fill a hole in a photo by its pattern."),
    "extend": Entry("p3i.cli.extend", "Continue a photo beyond its frame by its pattern."),
    "edit": Entry("p3i.cli.edit", "Lay a photo's objects anew by a changed program."),
    "points": Entry("p3i.cli.points", "List the objects: places, names, cells, and whether each is there."),
    "check": Entry("p3i.cli.check", "Report what is wrong, or odd, in programs."),
    "fmt": Entry("p3i.cli.fmt", "Rewrite programs in their canonical text."),
    "expand": Entry("p3i.cli.expand", "List the objects that a program draws."),
    "trace": Entry("p3i.cli.trace", "Show a search as a moving picture."),
    "score": Entry("p3i.cli.score", "Say how well a program explains a photo."),
    "eval": Entry("p3i.cli.eval", "Measure p3i on an annotated set of photos."),
    "examples": Entry("p3i.cli.examples", "Draw scenes whose program is known, as a set to measure with."),
    "doctor": Entry("p3i.cli.doctor", "Say what is installed here: for a report of a bug."),
}
"""In the order of `p3i --help`: the main job first."""


class LazyGroup(click.Group):
    """A click group whose commands are named in COMMANDS and imported only when they run."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        return importlib.import_module(COMMANDS[cmd_name].module).command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            close = difflib.get_close_matches(name, COMMANDS, n=1)
            advice = f"did you mean `p3i {close[0]}`?" if close else "`p3i --help` lists the commands"
            raise click.UsageError(f"there is no command `{name}`; {advice}", ctx)
        report.refuse_lost_folder()
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list["CompletionItem"]:
        from click.shell_completion import CompletionItem

        # click would import every command for its summary.
        found = [(name, entry.summary) for name, entry in COMMANDS.items() if name.startswith(incomplete)]
        items = [CompletionItem(name, help=summary) for name, summary in found]
        return items + click.Command.shell_complete(self, ctx, incomplete)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.summary) for name, entry in COMMANDS.items()])


def _print_version(ctx: click.Context, _param: click.Parameter, wanted: bool) -> None:
    if wanted:
        from p3i import __version__

        click.echo(f"p3i {__version__}")
        ctx.exit()


@click.command(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 done, 1 a check says no, 2 usage, 3 a file, 4 a program, 5 no pattern, "
    "6 some of many failed, 70 a bug, 130 interrupted, 143 ended.",
)
@click.option(
    "-V",
    "--version",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_print_version,
    help="Print the version and exit.",
)
def cli() -> None:
    """From one slanted photo of a plane with a repeating pattern to the camera's tilt and a short program."""


def run(argv: Sequence[str] | None = None) -> int:
    """Run the command line `argv` (without the program's name) and return the exit code; never raises.

    P3IError gives its own code, wrong usage 2, what the system refuses 3, an interrupt 130, a closed pipe 141
    without a word, and anything unforeseen 70 with one line (P3I_DEBUG=1 shows the traceback).
    """
    words = list(sys.argv[1:] if argv is None else argv)
    as_json = report.wants_json(words)
    try:
        outcome = _invoke(words)
        sys.stdout.flush()
        # bool is an int too, and a command that returns True has not failed.
        return outcome if type(outcome) is int else 0
    except P3IError as error:
        return report.p3i_error(error, as_json=as_json)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else str(error), err=True)
        return 2
    except click.ClickException as error:
        return report.click_error(error, as_json=as_json)
    except BrokenPipeError as error:
        streams.silence_stdout()
        return report.output_error(error, as_json=as_json) if isinstance(error, streams.OutputError) else 141
    except (KeyboardInterrupt, click.Abort):
        report.line("interrupted", as_json=as_json, code=130)
        return 130
    except SystemExit as leaving:
        return leaving.code if isinstance(leaving.code, int) else 0 if leaving.code is None else 70
    except OSError as error:
        return report.system_error(error, as_json=as_json)
    except Exception as error:
        return report.bug(error, as_json=as_json)


def _invoke(words: list[str]) -> object:
    """Run the command line as `main` of click does, but silent on interrupts and closed pipes."""
    if instruction := os.environ.get("_P3I_COMPLETE"):
        from click.shell_completion import shell_complete

        return shell_complete(cli, {}, "p3i", "_P3I_COMPLETE", instruction)
    try:
        with cli.make_context("p3i", words) as context:
            return cli.invoke(context)
    except click.exceptions.Exit as leaving:
        return leaving.exit_code


class Ending:
    """SIGTERM, and the terminal that hangs up: as an interrupt at first, at once when it comes again.

    So what was found is kept, and what was begun is tidied away. `code` is what the shell then sees.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        for name in ("SIGTERM", "SIGHUP"):
            if hasattr(signal, name):  # Windows has no SIGHUP
                signal.signal(getattr(signal, name), self._asked)

    def _asked(self, number: int, _frame: object) -> None:
        if self.code is not None:
            sys.exit(self.code)
        self.code = 128 + number
        raise KeyboardInterrupt


def main() -> None:
    """The console script `p3i`."""
    if not os.environ.get("P3I_DEBUG"):
        # Libraries warn their programmers, not our users, to whom each answer says what they need to know.
        warnings.simplefilter("ignore")
        os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    streams.secure()
    ending = Ending()
    code = run()
    sys.exit(code if ending.code is None else ending.code)


if __name__ == "__main__":
    main()
