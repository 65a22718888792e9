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
        inpaint,
        points,
        read_image,
        rectify,
        render,
        score,
        show,
        synth,
        tile,
        trace,
    )
    from p3i.errors import FileError, NoPatternError, P3IError, ProgramError, UsageError
    from p3i.grammar.ast import Program
    from p3i.interp.camera import Camera
    from p3i.language import check, dump, dumps, expand, format, load, loads
    from p3i.paint.edit_options import EditOptions
    from p3i.paint.extend_options import ExtendOptions
    from p3i.paint.inpaint_options import InpaintOptions
    from p3i.paint.options import RenderOptions
    from p3i.paint.points_options import PointsOptions
    from p3i.paint.rectify_options import RectifyOptions
    from p3i.paint.show_options import ShowOptions
    from p3i.paint.tile_options import TileOptions
    from p3i.search.config import SearchConfig
    from p3i.search.result import StopReason, SynthesisResult

_HOMES = {
    "Camera": "p3i.interp.camera",
    "EditOptions": "p3i.paint.edit_options",
    "FileError": "p3i.errors",
    "NoPatternError": "p3i.errors",
    "P3IError": "p3i.errors",
    "PointsOptions": "p3i.paint.points_options",
    "Program": "p3i.grammar.ast",
    "ProgramError": "p3i.errors",
    "RectifyOptions": "p3i.paint.rectify_options",
    "RenderOptions": "p3i.paint.options",
    "SearchConfig": "p3i.search.config",
    "StopReason": "p3i.search.result",
    "SynthesisResult": "p3i.search.result",
    "TileOptions": "p3i.paint.tile_options",
    "UsageError": "p3i.errors",
    "check": "p3i.language",
    "dump": "p3i.language",
    "dumps": "p3i.language",
    "edit": "p3i.api",
    "examples": "p3i.api",
    "eval_set": "p3i.api",
    "expand": "p3i.language",
    "extend": "p3i.api",
    "ExtendOptions": "p3i.paint.extend_options",
    "format": "p3i.language",
    "inpaint": "p3i.api",
    "InpaintOptions": "p3i.paint.inpaint_options",
    "load": "p3i.language",
    "loads": "p3i.language",
    "points": "p3i.api",
    "read_image": "p3i.api",
    "rectify": "p3i.api",
    "render": "p3i.api",
    "score": "p3i.api",
    "ShowOptions": "p3i.paint.show_options",
    "show": "p3i.api",
    "synth": "p3i.api",
    "tile": "p3i.api",
    "trace": "p3i.api",
}

__all__ = [  # noqa: RUF022  # in the order of use
    "synth", "show", "render", "rectify", "tile", "points", "inpaint", "extend", "edit", "score", "check",
    "format", "expand", "examples", "trace", "eval_set", "load", "loads", "dump", "dumps", "read_image",
    "Program", "Camera", "SearchConfig", "SynthesisResult", "StopReason", "RenderOptions", "PointsOptions",
    "ShowOptions", "RectifyOptions", "TileOptions", "InpaintOptions", "ExtendOptions",
    "EditOptions",
    "P3IError", "UsageError", "FileError", "ProgramError", "NoPatternError",
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
