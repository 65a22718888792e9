"""An annotated set as it is read: per photo the camera, the objects, and what else may be called right.

The format is that of `p3i examples` (docs/evaluation.md): a folder with annotations.json and the pictures.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from p3i.errors import FileError
from p3i.files import read_text
from p3i.interp.camera import Camera
from p3i.size import Size

STRUCTURES = ("lattice", "circular", "hybrid")
_FEWEST_ALTERNATIVE = 4


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A true ring in plane pixels: its middle [2], what takes a circle there [2, 2], how many slots."""

    center: np.ndarray
    plane_from_circle: np.ndarray
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The truth about one photo.

    `readings`: sets of pixels [N, 2], each a right answer to "where are the objects". `lattice`: base [2] and
    basis [2, 2] (u and v as rows) in plane pixels.
    """

    file: str
    size: Size
    structure: str
    camera: Camera
    pose_reliable: bool
    readings: tuple[np.ndarray, ...]
    lattice: tuple[np.ndarray, np.ndarray] | None
    rings: tuple[Ring, ...]
    accept_index: tuple[float, ...]
    accept_structure: tuple[str, ...]


def read_truth(folder: Path) -> tuple[Truth, ...]:
    """The truth about each photo of a set, in the order of its annotations.json.

    Raises FileError, with the photo's place in the list, for what is no such set.
    """
    path = folder / "annotations.json"
    try:
        told = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path} is no JSON ({error})") from None
    if not isinstance(told, list) or not told:
        raise FileError(f"{path} should hold a list of photos")
    found = []
    for number, entry in enumerate(told, start=1):
        name = entry.get("file") if isinstance(entry, dict) else None
        place = f"{path}, photo {number}" + (f" ({name})" if isinstance(name, str) else "")
        try:
            found.append(truth_of(entry))
        except KeyError as error:
            raise FileError(f"{place}: {error.args[0]!r} is missing") from None
        except (AttributeError, IndexError, TypeError, ValueError) as error:
            raise FileError(f"{place}: {error}") from None
    return tuple(found)


def truth_of(entry: Mapping[str, Any]) -> Truth:
    """The truth of one entry of annotations.json. Raises KeyError, TypeError, ValueError for what is none."""
    structure, pose = entry["structure"], entry["pose"]
    if structure not in STRUCTURES:
        raise ValueError(f"a structure is one of {', '.join(STRUCTURES)}, not {structure!r}")
    objects = _points(entry["centers"])
    lattice = entry.get("lattice")
    rings = entry.get("rings") or []
    return Truth(
        file=str(entry["file"]),
        size=Size(int(entry["width"]), int(entry["height"])),
        structure=structure,
        camera=Camera(float(pose["rx"]), float(pose["ry"]), float(pose.get("focal_mm", 35.0))),
        pose_reliable=bool(entry.get("pose_reliable", True)),
        readings=tuple(_readings(entry, objects)),
        lattice=(np.array(lattice["base"], float), np.array([lattice["u"], lattice["v"]], float))
        if lattice
        else None,
        rings=tuple(_ring(ring) for ring in rings),
        accept_index=tuple(entry.get("accept_index", [1])),
        accept_structure=tuple(entry.get("accept_structure", [structure])),
    )


def _readings(entry: Mapping[str, Any], objects: np.ndarray) -> list[np.ndarray]:
    """The objects, and what else the annotation lets pass for them."""
    found = [objects]
    indices = entry.get("indices") or []
    if 2 in entry.get("accept_index", [1]) and len(indices) == len(objects):
        odd = np.array([(i + j) % 2 for i, j in indices])
        found += [objects[odd == 0], objects[odd == 1]]  # a chessboard's dark and light corners
    if entry.get("accept_half_ring"):
        rings = [_points(ring["centers"]) for ring in entry["rings"]]
        for first in (0, 1):  # alternate segments
            halves = [ring[first::2] for ring in rings]
            found.append(np.concatenate(halves))
            if len(rings) > 1:
                found += [halves[0], halves[-1]]
        if len(rings) > 1:
            found += rings
    for other in entry.get("alt_objects", []):
        if len(other["centers"]) >= _FEWEST_ALTERNATIVE:
            found.append(_points(other["centers"]))
    return found


def _ring(told: Mapping[str, Any]) -> Ring:
    shape = np.eye(2)
    if "ellipse_e1" in told:  # under the annotation's lens the ring is no circle: it turns where it is one
        shape = np.column_stack([told["ellipse_e1"], told["ellipse_e2"]]).astype(float)
    count = told.get("slots") or told.get("n") or told.get("count") or 12
    return Ring(np.array(told["center"], float), shape, max(int(count), 1))


def _points(told: Any) -> np.ndarray:
    points = np.array(told, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2 or not np.isfinite(points).all():
        raise ValueError("'centers' should be a list of two or more [x, y]")
    return points
