"""Photographed textures on slanted planes before photographs, as annotated sets for `p3i eval`.

python benchmarks/textures.py --textures FOLDER... --backgrounds FOLDER --out SET [--small] [--seed 0]
p3i eval SET/cells                  # textures whose cell is known
p3i eval SET/poses                  # the others: of their objects only the pose is true

Pictures that nobody tuned to, with an exact truth. The textures are those of TEXTURES, by file name: tiles,
bricks, gratings, wallpapers and fences of Debian's packages ufoai-textures and sweethome3d (their archives
unpacked); backgrounds are any photographs without a pattern (mate-backgrounds has some). Each texture is laid
out a few times, its tiles mirrored at random where they may be, tilted by 10 to 55 degrees under a focal
between 26 and 55 mm, lit unevenly, covered in parts, blurred and compressed. With `--small` it
spans a quarter to a half of the longer side, off the middle, and more lies before it. A camera of 35 mm is
assumed by the search, so the pose is compared by its vanishing line, as everywhere in `p3i eval`. Everything
follows from the seed.
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.interp.camera import Camera
from p3i.size import Size

Array = NDArray[np.float64]
SUFFIXES = {".jpg", ".png"}
SIZES = (Size(800, 600), Size(1024, 683), Size(640, 640), Size(600, 800))
FOCALS_MM = (26.0, 28.0, 35.0, 35.0, 45.0, 55.0)


@dataclass(frozen=True, slots=True)
class Texture:
    """How often a texture's cell comes in it, `across` and `down`; `staggered` by half a cell in each row.

    `across` is 0 where the cell is not known: then only the pose is asked for. Copies may be `mirrored`.
    """

    across: int = 0
    down: int = 0
    staggered: bool = False
    mirrored: bool = False

    @property
    def basis(self) -> Array:
        """The steps [2, 2] as rows, in sides of the texture; one texture where its cell is not known."""
        if not self.across:
            return np.eye(2)
        half = 0.5 / self.across if self.staggered else 0.0
        return np.array([[1 / self.across, 0], [half, 1 / self.down]])


TEXTURES = {
    "9gratefloor01b": Texture(),
    "9gratefloor02": Texture(),
    "clangdark": Texture(),
    "floor008": Texture(8, 8, mirrored=True),
    "floor010": Texture(1, 1),
    "floor013": Texture(4, 4, mirrored=True),
    "floor015": Texture(2, 2, mirrored=True),
    "floor018": Texture(4, 4, mirrored=True),
    "floor029": Texture(4, 4, mirrored=True),
    "floor_gray": Texture(),
    "met_panel01": Texture(4, 4, mirrored=True),
    "metal02": Texture(),
    "mtl_fnce": Texture(),
    "roof11": Texture(5, 4, staggered=True),
    "solar": Texture(),
    "tile01": Texture(4, 4, mirrored=True),
    "tile03": Texture(6, 6, mirrored=True),
    "t_wll_fnctrm": Texture(),
    "wall043": Texture(),
    "wall_brick01": Texture(),
    "wallpaper011": Texture(),
    "window012": Texture(4, 5, mirrored=True),
    "blackAndWhiteTiles": Texture(2, 2),
    "blueTiles": Texture(2, 2, mirrored=True),
    "pavingStone": Texture(2, 2, staggered=True),
    "redTiles": Texture(3, 3, mirrored=True),
    "smallBricks": Texture(1, 2, staggered=True),
}


@dataclass(frozen=True, slots=True)
class Laid:
    """Where a texture lies: it spans so much and is at most so far `off` the middle, in program units.

    From so many up to so many things, the last not counted, lie before the picture.
    """

    span: tuple[float, float]
    off: float
    covers: tuple[int, int]


LARGE = Laid((45, 130), 12, (0, 3))
SMALL = Laid((24, 50), 25, (2, 6))


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument(
        "--textures", type=Path, nargs="+", required=True, help="folders, looked through whole"
    )
    parser.add_argument("--backgrounds", type=Path, required=True, help="a folder of photographs")
    parser.add_argument("--out", type=Path, required=True, help="the folder of the set")
    parser.add_argument("--count", type=int, default=81)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--small", action="store_true", help="textures that fill about a tenth of the picture"
    )
    asked = parser.parse_args(arguments)
    found = {one.stem: one for folder in asked.textures for one in _pictures(folder) if one.stem in TEXTURES}
    backgrounds = _pictures(asked.backgrounds)
    if not found or not backgrounds:
        parser.error("these folders hold none of the textures, or no backgrounds")
    random = np.random.default_rng(asked.seed)
    sets: dict[str, list[dict[str, Any]]] = {"cells": [], "poses": []}
    for part in sets:
        (asked.out / part / "images").mkdir(parents=True, exist_ok=True)
    for place in range(asked.count):
        name = sorted(found)[place % len(found)]
        background = _read(backgrounds[random.integers(len(backgrounds))])
        laid = SMALL if asked.small else LARGE
        picture, truth = scene(_read(found[name]), TEXTURES[name], background, random, laid)
        part, file = "cells" if TEXTURES[name].across else "poses", f"images/{place:03d}_{name}.jpg"
        cv2.imwrite(str(asked.out / part / file), picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
        sets[part].append({"file": file, **truth})
    for part, annotations in sets.items():
        (asked.out / part / "annotations.json").write_text(json.dumps(annotations))


def scene(
    texture: NDArray[np.uint8],
    told: Texture,
    background: NDArray[np.uint8],
    random: np.random.Generator,
    laid: Laid = LARGE,
) -> tuple[NDArray[np.uint8], dict[str, Any]]:
    """A picture [H, W, 3] of the texture on a plane before the background, and its annotation."""
    board = _laid_out(texture, told, random)
    size = SIZES[random.integers(len(SIZES))]
    tilt, around = math.radians(random.uniform(10, 55)), random.uniform(0, 2 * math.pi)
    normal = (math.sin(tilt) * math.cos(around), math.sin(tilt) * math.sin(around), math.cos(tilt))
    camera = Camera.from_normal(normal, focal_mm=float(random.choice(FOCALS_MM)))
    units_a_pixel = random.uniform(*laid.span) / max(board.shape[:2])
    turn = math.radians(random.normal(0, 12))
    plane_from_board = np.eye(3)
    plane_from_board[:2, :2] = units_a_pixel * np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    )
    middle = np.array(board.shape[1::-1]) / 2
    plane_from_board[:2, 2] = random.uniform(-laid.off, laid.off, 2) - plane_from_board[:2, :2] @ middle
    image_from_board = camera.image_from_plane(size).numpy() @ plane_from_board
    picture = _photographed(board, image_from_board, background, size, random, laid.covers)
    return picture, _truth(board, told.basis * texture.shape[1::-1], image_from_board, camera, size)


def _laid_out(texture: NDArray, told: Texture, random: np.random.Generator) -> NDArray:
    """The texture laid out until about 5 to 13 cells lie side by side."""
    cells = 8.0 if not told.across else abs(float(np.linalg.det(told.basis))) ** -0.5
    times = max(2 if cells < 4 else 1, round(random.uniform(5, 13) / cells))

    def copy() -> NDArray:
        flips = random.random(2) < 0.5 if told.mirrored else (False, False)
        return texture[:: -1 if flips[0] else 1, :: -1 if flips[1] else 1]

    return np.vstack([np.hstack([copy() for _ in range(times)]) for _ in range(times)])


def _photographed(
    board: NDArray,
    image_from_board: Array,
    background: NDArray,
    size: Size,
    random: np.random.Generator,
    covers: tuple[int, int],
) -> NDArray[np.uint8]:
    """The board through the camera: at twice the size, reduced; lit, covered, blurred, with noise."""
    width, height = size.width, size.height
    twice = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]]) @ image_from_board

    def seen(layer: NDArray) -> NDArray:
        large = cv2.warpPerspective(layer.astype(np.float32), twice, (2 * width, 2 * height))
        return cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)

    scale = 1.01 * max(width / background.shape[1], height / background.shape[0])
    behind = cv2.resize(background, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)[:height, :width]
    y, x = np.mgrid[0:height, 0:width]
    slope = random.normal(0, 0.25, 2)
    light = random.uniform(0.9, 1.6) * (1 + slope[0] * (x / width - 0.5) + slope[1] * (y / height - 0.5))
    covered = seen(np.ones(board.shape[:2]))[..., None]
    picture = seen(board) * light[..., None] + behind * (1 - covered)
    for _ in range(random.integers(*covers)):
        at, reach = random.uniform(0, 1, 2) * (width, height), random.uniform(0.04, 0.12) * width
        axes, colour = (int(reach), int(0.6 * reach)), random.uniform(20, 220, 3).tolist()
        cv2.ellipse(picture, at.astype(int).tolist(), axes, random.uniform(0, 180), 0, 360, colour, -1)
    picture = cv2.GaussianBlur(picture, (0, 0), random.uniform(0.3, 0.9)) + random.normal(0, 3, picture.shape)
    return picture.clip(0, 255).astype(np.uint8)


def _truth(
    board: NDArray, basis: Array, image_from_board: Array, camera: Camera, size: Size
) -> dict[str, Any]:
    """The annotation, in the terms of docs/evaluation.md; `basis` [2, 2] in pixels of the board."""
    assumed = camera.refocused(35.0)
    plane_from_board = np.linalg.inv(assumed.image_from_plane(size).numpy()) @ image_from_board
    plane_from_board *= size.unit_px / plane_from_board[2, 2]  # plane pixels
    steps = basis @ plane_from_board[:2, :2].T
    base = plane_from_board[:2, :2] @ (basis.sum(0) / 2) + plane_from_board[:2, 2]
    reach = np.arange(-40, 41)
    middles = (np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 2) + 0.5) @ basis
    middles = middles[((middles >= 0) & (middles < board.shape[1::-1])).all(1)]
    seen = np.column_stack([middles, np.ones(len(middles))]) @ image_from_board.T
    centers = seen[:, :2] / seen[:, 2:]
    centers = centers[((centers >= 0) & (centers < (size.width, size.height))).all(1)]
    return {
        "width": size.width,
        "height": size.height,
        "structure": "lattice",
        "object": "cell",
        "centers": centers.tolist(),
        "pose": {"rx": assumed.rx_deg, "ry": assumed.ry_deg, "focal_mm": 35},
        "pose_reliable": True,
        "lattice": {"base": base.tolist(), "u": steps[0].tolist(), "v": steps[1].tolist()},
    }


def _pictures(folder: Path) -> list[Path]:
    return sorted(one for one in folder.rglob("*") if one.suffix.lower() in SUFFIXES)


def _read(path: Path) -> NDArray[np.uint8]:
    picture = cv2.imread(str(path))
    if picture is None:
        raise SystemExit(f"{path} is no picture")
    return np.asarray(picture, np.uint8)


if __name__ == "__main__":
    main()
