"""`p3i check`: what is wrong, or odd, in programs and sketches."""

import sys

import click

from p3i import language
from p3i.cli import grouped, options, programs
from p3i.cli.inputs import INPUT
from p3i.errors import P3IError
from p3i.grammar.layout import source_text
from p3i.grammar.report import report_human, report_json, summary


@grouped.command("check")
@click.argument("files", metavar="FILE...", type=INPUT, nargs=-1, required=True)
@click.option("--strict", is_flag=True, help="Hold the programs to Table 1 of the paper, to the letter.")
@options.quiet
@options.error_format
def command(files: tuple[str, ...], strict: bool, quiet: bool, error_format: str) -> int:
    """Report every error and warning in programs and sketches, each with its place and what to write instead.

    FILE is a program, a glob, a folder (its *.p3p files), @LIST (a text file of such names), or - for
    standard input; of a PNG or SVG that carries its program that one is checked. Findings go to stdout; with
    --error-format json as one object a line. Warnings exit 0, errors 4.
    """
    as_json = error_format == "json"
    color = programs.coloured(sys.stdout)
    code = errors = warnings = inputs = 0
    for source in programs.sources(files, as_json=as_json):
        if isinstance(source, P3IError):
            code = code or source.exit_code
            continue
        path, data = source
        inputs += 1
        found = language.check(data, strict=strict)
        text, name = source_text(data), programs.shown(path)
        if as_json:
            programs.write_out(report_json(found, source=text, path=name))
        elif found:
            separator = "\n" if errors or warnings else ""
            programs.write_out(separator + report_human(found, source=text, path=name, color=color))
        errors += sum(finding.severity == "error" for finding in found)
        warnings += sum(finding.severity == "warning" for finding in found)
    if not (quiet or as_json) and inputs:
        click.echo(summary(errors=errors, warnings=warnings, inputs=inputs), err=True)
    return 4 if errors else code
