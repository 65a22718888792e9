"""`p3i fmt`: programs in their canonical text."""

import difflib

import click

from p3i import language
from p3i.cli import grouped, options, programs, report
from p3i.cli.inputs import INPUT
from p3i.errors import P3IError, UsageError
from p3i.grammar.layout import source_text
from p3i.grammar.parse_error import ParseError
from p3i.grammar.printer import Layout


@grouped.command("fmt")
@click.argument("files", metavar="FILE...", type=INPUT, nargs=-1, required=True)
@click.option("--check", "only_check", is_flag=True, help="Write nothing; exit 1 if a file would change.")
@click.option("--diff", "only_diff", is_flag=True, help="Write nothing; print what would change.")
@click.option(
    "--layout",
    type=click.Choice(["python", "table1"]),
    default=None,
    help="The spelling: python (the default), or table1 for programs inside Table 1.",
)
@click.option("--strict", is_flag=True, help="Read Table 1 to the letter, and write layout table1.")
@options.quiet
@options.error_format
def command(
    files: tuple[str, ...],
    only_check: bool,
    only_diff: bool,
    layout: Layout | None,
    strict: bool,
    quiet: bool,
    error_format: str,
) -> int:
    """Rewrite programs and sketches in place, in the one spelling that p3i prints.

    FILE is a program, a glob, a folder (its *.p3p files), @LIST (a text file of such names), or - to read
    standard input and write standard output. Comments and the header block stay. A file with errors stays as
    it is, and so does every file whose new text would not mean the same. Of a drawing from standard input the
    program that it carries is written; its file stays.
    """
    if strict and layout == "python":
        raise UsageError("strict text exists in layout table1 only: leave out --layout python or --strict")
    as_json = error_format == "json"
    code = changed = 0
    for source in programs.sources(files, as_json=as_json, in_place=True):
        if isinstance(source, P3IError):
            code = code or source.exit_code
            continue
        path, data = source
        name = programs.shown(path)
        try:
            text = language.format(data, layout=layout, strict=strict, path=name)
            language.verify_format(data, text, layout=layout, strict=strict)
            differs = text.encode() != data
            changed += differs
            if only_diff:
                programs.write_out(_diff(source_text(data), text, name))
            elif path == programs.STDIN:
                if not only_check:
                    programs.write_out(text)
            elif differs and not only_check:
                language.write(path, text)
            if differs and not quiet and path != programs.STDIN:
                report.line(f"{name} {'differs' if only_check or only_diff else 'rewritten'}", kind="info")
        except ParseError as error:
            code = programs.write_errors(error, as_json=as_json)
        except P3IError as error:
            code = code or report.p3i_error(error, as_json=as_json)
    return code or int(only_check and changed > 0)


def _diff(before: str, after: str, name: str) -> str:
    """A unified diff; a line without an end is marked as `diff` does."""
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    lines = difflib.unified_diff(old, new, f"{name} (now)", f"{name} (formatted)")
    unended = "\n\\ No newline at end of file\n"
    return "".join(line if line.endswith("\n") else line + unended for line in lines)
