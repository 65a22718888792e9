"""p3i: from one slanted photo of a plane with a repeating pattern to the camera and a short program.

    import p3i

    result = p3i.synth("tiles.jpg")
    print(p3i.format(result.program))

Every name is loaded when it is first used: `p3i.check` and `p3i.format` never import torch.
"""

import importlib
import sys
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from p3i.api import (
        edit,
        eval_set,
        examples,
        extend,
        find_marred,
        inpaint,
        points,
        read_image,
        rectify,
        render,
        score,
        show,
        synth,
        synth_all,
        tile,
        trace,
    )
    from p3i.errors import FileError, NoPatternError, P3IError, ProgramError, UsageError
    from p3i.grammar.ast import Program
    from p3i.grammar.diagnostics import Diagnostic
    from p3i.grammar.parse_error import ParseError
    from p3i.grammar.sketch import Sketch
    from p3i.interp.camera import Camera
    from p3i.language import check, dump, dumps, expand, format, load, load_sketch, loads
    from p3i.options.cell import CellSize, parse_cell
    from p3i.options.edit import EditOptions
    from p3i.options.extend import ExtendOptions, Margins, parse_margins
    from p3i.options.inpaint import FindOptions, InpaintOptions
    from p3i.options.points import PointsOptions
    from p3i.options.rectify import RectifyOptions
    from p3i.options.render import RenderOptions
    from p3i.options.show import ShowOptions
    from p3i.options.tile import TileOptions
    from p3i.search.config import SearchConfig
    from p3i.search.result import Candidate, Other, StopReason, SynthesisResult
    from p3i.size import Size
    from p3i.vision.image import Image

_HOMES = {
    "Camera": "p3i.interp.camera",
    "Candidate": "p3i.search.result",
    "CellSize": "p3i.options.cell",
    "check": "p3i.language",
    "Diagnostic": "p3i.grammar.diagnostics",
    "dump": "p3i.language",
    "dumps": "p3i.language",
    "edit": "p3i.api",
    "EditOptions": "p3i.options.edit",
    "eval_set": "p3i.api",
    "examples": "p3i.api",
    "expand": "p3i.language",
    "extend": "p3i.api",
    "ExtendOptions": "p3i.options.extend",
    "FileError": "p3i.errors",
    "format": "p3i.language",
    "Image": "p3i.vision.image",
    "inpaint": "p3i.api",
    "find_marred": "p3i.api",
    "InpaintOptions": "p3i.options.inpaint",
    "FindOptions": "p3i.options.inpaint",
    "load": "p3i.language",
    "load_sketch": "p3i.language",
    "loads": "p3i.language",
    "Margins": "p3i.options.extend",
    "NoPatternError": "p3i.errors",
    "Other": "p3i.search.result",
    "P3IError": "p3i.errors",
    "parse_cell": "p3i.options.cell",
    "parse_margins": "p3i.options.extend",
    "ParseError": "p3i.grammar.parse_error",
    "points": "p3i.api",
    "PointsOptions": "p3i.options.points",
    "Program": "p3i.grammar.ast",
    "ProgramError": "p3i.errors",
    "read_image": "p3i.api",
    "rectify": "p3i.api",
    "RectifyOptions": "p3i.options.rectify",
    "render": "p3i.api",
    "RenderOptions": "p3i.options.render",
    "score": "p3i.api",
    "SearchConfig": "p3i.search.config",
    "show": "p3i.api",
    "ShowOptions": "p3i.options.show",
    "Size": "p3i.size",
    "Sketch": "p3i.grammar.sketch",
    "StopReason": "p3i.search.result",
    "synth": "p3i.api",
    "synth_all": "p3i.api",
    "SynthesisResult": "p3i.search.result",
    "tile": "p3i.api",
    "TileOptions": "p3i.options.tile",
    "trace": "p3i.api",
    "UsageError": "p3i.errors",
}

__all__ = [  # noqa: RUF022  # in the order of use
    "synth", "synth_all", "show", "render", "rectify", "tile", "points", "inpaint", "find_marred", "extend",
    "edit", "score",
    "check", "format", "expand", "examples", "trace", "eval_set", "load", "load_sketch", "loads", "dump",
    "dumps", "read_image", "Program", "Sketch", "Diagnostic", "Image", "Size", "Camera", "SearchConfig",
    "SynthesisResult", "Candidate", "Other", "StopReason", "RenderOptions", "PointsOptions", "ShowOptions",
    "RectifyOptions", "TileOptions", "InpaintOptions", "FindOptions", "ExtendOptions",
    "EditOptions", "CellSize",
    "parse_cell", "Margins", "parse_margins", "P3IError", "UsageError", "FileError", "ProgramError",
    "ParseError", "NoPatternError",
]  # fmt: skip


if "IPython" in sys.modules:  # a notebook draws what it shows
    importlib.import_module("p3i.notebook").register(sys.modules["IPython"])


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'p3i' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value  # so that this function is asked once for each name
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
