"""`p3i examples`: rendered scenes with known truth."""

import click

from p3i import api
from p3i.cli import grouped, options, progress


@grouped.command("examples")
@click.argument("folder", metavar="DIR")
@click.option(
    "--seed",
    type=int,
    metavar="N",
    default=0,
    show_default=True,
    help="Which set; equal seeds give equal files.",
)
@click.option("--lattices", type=int, metavar="N", default=4, show_default=True, help="How many lattices.")
@click.option("--rings", type=int, metavar="N", default=4, show_default=True, help="How many rings and arcs.")
@click.option(
    "--hybrids",
    type=int,
    metavar="N",
    default=4,
    show_default=True,
    help="How many rings around one centre, fans of arcs, and rings along a line.",
)
@click.option(
    "--focals", is_flag=True, help="A third of the rings get another lens (24 to 60 mm) than 35 mm."
)
@options.force
@options.quiet
@options.error_format
def command(
    folder: str,
    *,
    seed: int,
    lattices: int,
    rings: int,
    hybrids: int,
    focals: bool,
    force: bool,
    quiet: bool,
    error_format: str,
) -> None:
    """Draw photo-like scenes into the folder DIR, with the truth about each.

    DIR/images holds the pictures, DIR/programs the program of each, DIR/annotations.json the cameras and the
    places of all objects in pixels. The pictures carry no focal length: what looks at them assumes 35 mm.
    """
    with progress.bar("examples", wanted=not quiet) as update:
        api.examples(
            folder,
            seed=seed,
            lattices=lattices,
            rings=rings,
            hybrids=hybrids,
            focals=focals,
            force=force,
            progress=update,
        )
