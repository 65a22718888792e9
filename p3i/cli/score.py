"""`p3i score`: how well a program explains a photo."""

import json
from pathlib import Path
from typing import Any

import click

from p3i import api
from p3i.cli import options, search_options
from p3i.search.config import SearchConfig


@click.command("score", short_help="Say how well a program explains a photo.")
@click.argument("image", metavar="PHOTO", type=options.INPUT)
@click.argument("program", metavar="PROG", type=options.INPUT)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="How to print the numbers.",
)
@click.option(
    "--focal",
    "focal_mm",
    type=float,
    metavar="MM",
    help="35 mm-equivalent focal length; by default the program's, else that of the photo, else 35.",
)
@search_options.features
@search_options.weights
@search_options.device
@search_options.threads
@options.error_format
def command(
    image: str, program: str, form: str, weights: str | None, error_format: str, **chosen: Any
) -> None:
    """Compare the photo IMAGE with itself at the neighbouring draws of the program PROG.

    Prints equation 2 of the paper as printed there (the sum of squared feature differences over the
    edges; less is better, but a smaller pattern has less too) and the normalised score (more is better),
    by which `p3i synth` chooses.
    """
    config = SearchConfig(weights=Path(weights) if weights else None, **chosen)
    found = api.score(image, program, config)
    if form == "json":
        record = {
            "image": image,
            "program": program,
            "equation2": found.equation2,
            "edges": found.edges,
            "score": found.normalised,
            "features": config.features,
        }
        click.echo(json.dumps(record))
        return
    click.echo(f"score       {found.normalised:.4f}   normalised; more is better")
    click.echo(f"equation 2  {found.equation2:.6g}   over {found.edges} edges, as printed; less is better")
