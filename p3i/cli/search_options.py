"""The options of the commands that look at features, each written once, in the words of SearchConfig."""

import click

from p3i.cli.options import Decorator
from p3i.records import told
from p3i.search.config import SearchConfig

sentence, default = told(SearchConfig)

features: Decorator = click.option(
    "--features",
    metavar="NAME",
    default=default("features"),
    show_default=True,
    help=sentence("features"),
)
"""`--features NAME`."""

weights: Decorator = click.option("--weights", type=click.Path(), metavar="FILE", help=sentence("weights"))
"""`--weights FILE`."""

device: Decorator = click.option(
    "--device",
    default=default("device"),
    show_default=True,
    help=sentence("device"),
)
"""`--device NAME`."""

threads: Decorator = click.option(
    "--threads",
    type=int,
    default=default("threads"),
    show_default=True,
    help=sentence("threads"),
)
"""`--threads N`."""
