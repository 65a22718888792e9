"""The options of the commands that look at features, each written once, in the words of SearchConfig."""

import click

from p3i.cli.options import Decorator, field
from p3i.records import told
from p3i.search.config import SearchConfig

sentence, default = told(SearchConfig)

features: Decorator = field(SearchConfig, "features", metavar="NAME")
"""`--features NAME`."""

weights: Decorator = click.option("--weights", type=click.Path(), metavar="FILE", help=sentence("weights"))
"""`--weights FILE`."""

device: Decorator = field(SearchConfig, "device")
"""`--device NAME`."""

threads: Decorator = field(SearchConfig, "threads", type=int)
"""`--threads N`."""
