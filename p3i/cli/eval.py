"""`p3i eval`: how right p3i is on an annotated set."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from p3i import api, files
from p3i.cli import grouped, options, progress
from p3i.search.config import SearchConfig

# The columns of the two tables: a key of the row or of the summary, its heading, how its value is printed.
_PHOTO = (
    ("pose_deg", "pose", "{:.2f}"), ("pose_l1", "pose L1", "{:.2f}"), ("det_gt", "det-gt", "{:.3f}"),
    ("gt_det", "gt-det", "{:.3f}"), ("chamfer", "chamfer", "{:.3f}"), ("f1", "f1", "{:.2f}"),
    ("f1_free", "f1 free", "{:.2f}"), ("index", "index", "{:g}"), ("structure_ok", "structure", "{}"),
)  # fmt: skip
_GROUP = (
    ("n", "photos", "{}"), ("answered", "answered", "{:.0%}"), ("pose_median", "pose median", "{:.2f}"),
    ("pose_mean_answered", "mean, answered", "{:.2f}"), ("pose_l1", "pose L1", "{:.2f}"),
    ("pose<2", "pose < 2", "{:.0%}"), ("det_gt", "det-gt", "{:.3f}"), ("gt_det", "gt-det", "{:.3f}"),
    ("chamfer_answered", "chamfer, answered", "{:.3f}"), ("f1", "f1", "{:.2f}"),
    ("f1_free", "f1 free", "{:.2f}"), ("lattice_ok", "lattice", "{:.0%}"),
    ("structure_ok", "structure", "{:.0%}"), ("seconds", "s", "{:.1f}"),
)  # fmt: skip


@grouped.command("eval")
@click.argument("folder", metavar="SET", type=click.Path())
@grouped.group(
    "What to score",
    click.option(
        "--results", type=click.Path(), metavar="FILE", help="Score these JSON lines; search nothing."
    ),
    click.option("--only", metavar="TEXT", help="Only photos whose name contains this."),
    click.option(
        "--fold", metavar="K/N", help="Part K of N of the set, 1/2 or 2/2: as many of each kind of photo."
    ),
    click.option("--limit", type=int, metavar="N", help="Only the first N photos."),
)
@grouped.group(
    "Output",
    click.option("--out", type=click.Path(), metavar="FILE", help="Write all numbers as JSON."),
    options.force,
)
@grouped.group(
    "The search",
    options.of(SearchConfig, "structure", "extent", "focal_mm", "features", "weights"),
    options.of(SearchConfig, "strict", "time_s", "seed", "threads"),
    click.option(
        "--jobs", type=int, metavar="N", default=1, show_default=True, help="Processes to search in."
    ),
)
@options.quiet
@options.error_format
def command(
    folder: str,
    *,
    results: str | None,
    out: str | None,
    force: bool,
    jobs: int,
    only: str | None,
    limit: int | None,
    fold: str | None,
    quiet: bool,
    error_format: str,
    **given: Any,
) -> None:
    """Search each photo of the annotated set in the folder SET, and say how far the answers lie from truth.

    pose is the angle to the true normal in degrees, pose L1, det-gt, gt-det and chamfer are the paper's
    measures, f1 counts objects found within a quarter of their spacing, f1 free after the best shift or
    turn, index is the size of the cell in true cells. `p3i examples` makes such a set.
    """
    config = options.chosen(SearchConfig, given)
    if out is not None:
        files.check_writable(Path(out), force=force)
    with progress.bar("eval", wanted=not quiet) as update:
        score = api.eval_set(
            folder, config, results=results, jobs=jobs, only=only, limit=limit, fold=fold, progress=update
        )
    _print(score)
    if out is not None:
        with files.replacing(Path(out), force=force) as stream:
            stream.write(json.dumps(score.as_json(), indent=1) + "\n")


def _print(score: "api.SetScore") -> None:
    """Both tables on stdout, and what the search cost."""
    from rich.console import Console

    wide = Console(width=160, highlight=False)
    rows = [
        (row.file.rpartition("/")[2], row.structure, *_cells(row.as_json(), _PHOTO), row.error)
        for row in score.rows
    ]
    wide.print(_table(("photo", "truth", *(title for _, title, _ in _PHOTO), ""), rows))
    if score.fold is not None:
        click.echo(f"fold {score.fold} of the set, {len(score.rows)} photos")
    groups = [(name, *_cells(means, _GROUP)) for name, means in score.summary.items()]
    wide.print(_table(("structure", *(title for _, title, _ in _GROUP)), groups))
    if score.wall is not None and score.cpu is not None:
        each = len(score.rows)
        cost = f"CPU {score.cpu / each:.1f} s and wall {score.wall / each:.1f} s a photo"
        click.echo(f"{cost}, peak memory {score.peak_mb:.0f} MB a process")


def _cells(values: Mapping[str, Any], columns: Sequence[tuple[str, str, str]]) -> list[str]:
    texts = []
    for key, _, form in columns:
        value = values.get(key)
        value = {True: "yes", False: "no"}[value] if isinstance(value, bool) else value
        texts.append("-" if value is None else form.format(value))
    return texts


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> Any:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE, pad_edge=False, padding=(0, 1))
    for place, title in enumerate(titles):
        table.add_column(title, justify="left" if place == 0 or not title else "right", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    return table
