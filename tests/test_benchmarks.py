"""The scripts in benchmarks/ keep up with the code, and what they measure is what they say."""

import ast
import importlib
import pkgutil
import re
import runpy
import types
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

import p3i
from p3i.evaluation.annotations import annotation
from p3i.evaluation.lattice_scenes import lattice_scene
from p3i.evaluation.truth import truth_of
from p3i.interp.camera import Camera, project
from p3i.search.result import StopReason, SynthesisResult
from p3i.size import Size

SCRIPTS = sorted((Path(__file__).parent.parent / "benchmarks").rglob("*.py"))


def names_of_p3i(path: Path) -> Iterator[str]:
    """Every name of p3i that a script imports, and every string that spells one."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "p3i":
            yield from (f"{node.module}:{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from re.findall(r"\Ap3i(?:\.\w+)+\Z", node.value)


def is_there(name: str) -> bool:
    module, _, inner = name.partition(":")
    try:
        if not inner:
            pkgutil.resolve_name(name)
        elif not hasattr(importlib.import_module(module), inner):
            importlib.import_module(f"{module}.{inner}")
    except (ImportError, AttributeError):
        return False
    return True


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.name)
def test_what_a_script_takes_from_p3i_is_there(path: Path) -> None:
    assert [name for name in names_of_p3i(path) if not is_there(name)] == []


def test_the_ablations_replace_functions_by_names_that_this_test_sees() -> None:
    names = set(names_of_p3i(next(path for path in SCRIPTS if path.stem == "ablations")))
    assert "p3i.search.fit.grow.refine" in names
    assert not is_there("p3i.search.fit.grow.no_such") and not is_there("p3i.search:register")


def shipped(folder: Path, monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """The module of the pattern-free crops, over two painted pictures instead of scikit-image's."""
    monkeypatch.syspath_prepend(str(SCRIPTS[0].parent))
    module = importlib.import_module("pattern_free")
    random = np.random.default_rng(0)
    for name in ("astronaut.png", "moon.png"):
        cv2.imwrite(str(folder / name), random.integers(0, 255, (600, 700, 3), np.uint8))
    monkeypatch.setattr(module, "PHOTOS", ("astronaut.png", "moon.png"))
    monkeypatch.setattr(module, "folder", lambda: folder)
    return module


def test_pattern_free_crops_follow_from_the_seed_and_those_at_other_scales_are_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = shipped(tmp_path, monkeypatch)
    for cut in (module.crops, module.scaled_crops):
        first, again, other = (list(cut(4, seed)) for seed in (0, 0, 1))
        assert [name for name, _ in first] == [name for name, _ in again] != [name for name, _ in other]
        assert all(np.array_equal(a.pixels, b.pixels) for (_, a), (_, b) in zip(first, again, strict=True))
    scales = [float(name.split(" x ")[1].split()[0]) for name, _ in module.scaled_crops(4)]
    assert all(scale < 0.8 or scale > 1.3 for scale in scales) and min(scales) < 1 < max(scales)


def test_no_pattern_free_crop_shows_the_flag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = shipped(tmp_path, monkeypatch)
    photo = np.zeros((600, 700, 3), np.uint8)
    photo[:, : module.FLAG_PX - 4] = 255
    cv2.imwrite(str(tmp_path / "astronaut.png"), photo)
    for cut in (module.crops, module.scaled_crops):
        assert all(image.pixels.max() < 0.5 for name, image in cut(12) if name.startswith("astronaut"))


def test_what_is_answered_of_pattern_free_crops_is_told_with_its_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = shipped(tmp_path, monkeypatch)
    program = p3i.loads("Draw(x=0, y=0)")
    answers = iter([None, program, None])

    def found(_image: object, _config: object) -> SynthesisResult:
        answer, bits = next(answers), 12.0
        if answer is None:
            return SynthesisResult(program=None, stop=StopReason.NO_PATTERN, bits=bits)
        return SynthesisResult(
            program=answer, stop=StopReason.FOUND, structure="circular", score=0.4, bits=80.0
        )

    monkeypatch.setattr(p3i, "synth", found)
    module.searched("crops", module.crops(3), tmp_path / "out.jsonl")
    told = capsys.readouterr().out
    assert "2 of 3 refused (66.7%)" in told and "answered: 80" in told and "refused: 12" in told
    assert len((tmp_path / "out.jsonl").read_text().splitlines()) == 3


def test_the_textures_lie_where_their_annotation_says() -> None:
    textures = runpy.run_path(str(next(path for path in SCRIPTS if path.stem == "textures")))
    dots = np.full((120, 120, 3), 40, np.uint8)
    for x in range(15, 120, 30):
        for y in range(15, 120, 30):
            cv2.circle(dots, (x, y), 8, (230, 230, 230), -1)
    told, black = textures["Texture"](4, 4), np.zeros((700, 900, 3), np.uint8)
    picture, truth = textures["scene"](dots, told, black, np.random.default_rng(4))
    centers, size = np.array(truth["centers"]), Size(truth["width"], truth["height"])
    assert len(centers) > 20 and picture.shape[:2] == (size.height, size.width)
    grey = picture.mean(2)
    at = [grey[int(y), int(x)] for x, y in np.floor(centers)]
    assert np.median(at) > 1.5 * np.median(grey[grey > 20])
    camera = Camera(truth["pose"]["rx"], truth["pose"]["ry"], 35.0)
    plane, _ = project(torch.linalg.inv(camera.image_from_plane(size)), torch.from_numpy(centers))
    lattice = truth["lattice"]
    steps = (plane.numpy() * size.unit_px - lattice["base"]) @ np.linalg.inv([lattice["u"], lattice["v"]])
    assert np.allclose(steps, np.round(steps), atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_what_a_new_view_is_annotated_with_is_what_it_shows(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS[0].parent))
    views = importlib.import_module("views")
    scene = lattice_scene(3)
    entry = {**annotation(scene, file="a.png"), "accept_index": [1]}
    view = views.view_of(entry, np.random.default_rng(seed))
    photo = (255 * scene.pixels[..., ::-1]).round().astype(np.uint8)
    shown = views.taken(photo, view, np.random.default_rng(seed))
    assert shown.shape == (view.size.height, view.size.width, 3)
    found = truth_of({**views.truth(entry, view), "file": "b.png"})
    centers, size = found.readings[0], found.size
    assert 12 <= len(centers) < len(entry["centers"]) or view.shows(entry["centers"]).all()
    plane, _ = project(torch.linalg.inv(found.camera.image_from_plane(size)), torch.from_numpy(centers))
    assert found.lattice is not None
    base, basis = found.lattice
    steps = (plane.numpy() * size.unit_px - base) @ np.linalg.inv(basis)
    assert np.abs(steps - np.round(steps)).max() < 0.03  # pixels are told to hundredths
    # An object is where it is said to be: the patch there is that of the photo, turned and lit anew.
    back = np.linalg.inv(view.from_photo)
    x, y = centers[len(centers) // 2]
    from_x, from_y, depth = back @ [x, y, 1.0]
    was, now = photo[round(from_y / depth), round(from_x / depth)], shown[round(y), round(x)]
    assert np.abs(was.astype(float) - now).max() < 90
