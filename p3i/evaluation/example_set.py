"""A folder of scenes with their truth, in the form of the annotated photo sets."""

import dataclasses
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path

from p3i.errors import FileError, UsageError
from p3i.evaluation.annotations import annotation
from p3i.evaluation.scenes import Scene, scene
from p3i.files import check_writable, make_folder, replacing, write_bytes
from p3i.grammar.ast import Header
from p3i.grammar.printer import format_program
from p3i.search.result import StructureFound
from p3i.vision.write import encode

MOST = 1000
"""Scenes of one structure in a set: scene k of the set of a seed has the seed `seed * MOST + k`."""

_NAMES: Mapping[StructureFound, str] = {"lattice": "lattice", "circular": "ring", "hybrid": "hybrid"}


def write_examples(
    folder: Path,
    counts: Mapping[StructureFound, int],
    *,
    seed: int,
    focals: bool = False,
    force: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> tuple[Path, ...]:
    """Draw scenes into `folder`: images/, programs/ and annotations.json; returns the pictures' paths.

    `counts` says how many of each structure; `focals` gives a third of the rings another lens than 35 mm.
    The same call writes the same bytes. Raises UsageError for counts and seeds out of range, FileError where
    a file of the set exists already (without `force`) or the folder cannot be written to; annotations.json
    is written last, so a set that has one is whole.
    """
    if seed < 0:
        raise UsageError(f"a seed is a whole number from 0, not {seed}")
    for structure, count in counts.items():
        if not 0 <= count <= MOST:
            raise UsageError(f"a set has 0 to {MOST} scenes of a structure, not {count} ({structure})")
    todo: list[tuple[StructureFound, int]] = []
    for structure, count in counts.items():
        todo.extend((structure, k) for k in range(count))
    if not todo:
        raise UsageError("a set of no scenes: ask for lattices, rings or hybrids")
    if os.path.lexists(folder) and not os.path.isdir(folder):
        raise FileError(f"{folder} is a file; a set of examples needs a folder")
    if not force:
        _refuse_what_exists(folder, [name_of(structure, k) for structure, k in todo])
    for part in ("images", "programs"):
        make_folder(folder / part)
    check_writable(folder / "annotations.json", force=force)
    pictures, said = [], []
    for done, (structure, k) in enumerate(todo):
        if progress is not None:
            progress(name_of(structure, k), done / len(todo))
        changes = {"focals": focals} if structure == "circular" else {}
        drawn = scene(structure, MOST * seed + k, **changes)
        picture = _write_scene(folder, name_of(structure, k), drawn, force=force)
        pictures.append(picture)
        said.append(annotation(drawn, f"images/{picture.name}"))
    with replacing(folder / "annotations.json", force=force) as stream:
        stream.write("[\n" + ",\n".join(json.dumps(entry) for entry in said) + "\n]\n")
    return tuple(pictures)


def name_of(structure: StructureFound, k: int) -> str:
    """What the files of scene k are called, without their suffix."""
    return f"{_NAMES[structure]}_{k:03}"


def _write_scene(folder: Path, name: str, drawn: Scene, *, force: bool) -> Path:
    """Write picture and program; the program's header names the picture."""
    picture = folder / "images" / (f"{name}.png" if drawn.jpeg is None else f"{name}.jpg")
    data = encode(drawn.pixels, kind=".png") if drawn.jpeg is None else drawn.jpeg
    write_bytes(picture, data, force=force)
    header = dataclasses.replace(drawn.program.header or Header(), image=f"../images/{picture.name}")
    with replacing(folder / "programs" / f"{name}.p3p", force=force) as stream:
        stream.write(format_program(dataclasses.replace(drawn.program, header=header)))
    return picture


def _refuse_what_exists(folder: Path, names: list[str]) -> None:
    """Raise FileError before anything is drawn, where a file of the set is there already."""
    targets = [folder / "annotations.json"]
    for name in names:
        targets += [folder / "programs" / f"{name}.p3p"]
        targets += [folder / "images" / f"{name}{suffix}" for suffix in (".png", ".jpg")]
    for target in targets:
        if os.path.lexists(target):
            raise FileError(f"{target} exists already: name another folder, or say --force")
