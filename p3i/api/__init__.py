"""The commands as functions: what `p3i synth`, `render`, `check`, ... do, for Python programs.

Functions load what they need when they are called, so that importing this module costs nothing.
"""

from typing import TYPE_CHECKING

from p3i.api.pictures import edit, extend, find_marred, inpaint, points, rectify, render, show, tile
from p3i.api.search import (
    Polygon,
    Progress,
    Trace,
    eval_set,
    examples,
    read_image,
    score,
    synth,
    synth_all,
    trace,
)
from p3i.language import check, dump, dumps, expand, format, load, load_sketch, loads

if TYPE_CHECKING:
    from p3i.evaluation.score_set import SetScore as SetScore

__all__ = [  # noqa: RUF022  # in the order of use
    "synth", "synth_all", "show", "render", "rectify", "tile", "points", "inpaint", "find_marred", "extend",
    "edit", "score",
    "check", "format", "expand", "examples", "trace", "eval_set",
    "load", "load_sketch", "loads", "dump", "dumps", "read_image", "Polygon", "Progress", "Trace",
]  # fmt: skip
