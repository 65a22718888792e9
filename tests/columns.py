"""A pattern of which every n-th object in the order of the loops may be of one kind only."""

import cv2
import numpy as np

from p3i.grammar.ast import Affine, CameraPose, Draw, For, Program
from p3i.size import Size
from p3i.vision.image import Image


def two_kinds_of_columns(rows: int, columns: int) -> tuple[Image, Program]:
    """Dark discs in a lattice of 16 pixels, seen straight on; every second column light ellipses."""
    size = Size(16 * columns, 16 * rows)
    pixels = np.full((size.height, size.width, 3), 140, np.uint8)
    for row in range(rows):
        for column in range(columns):
            at = 16 * column + 8, 16 * row + 8
            if column % 2:
                cv2.ellipse(pixels, at, (6, 3), 0, 0, 360, (235, 220, 200), -1, cv2.LINE_AA)
            else:
                cv2.circle(pixels, at, 4, (40, 50, 90), -1, cv2.LINE_AA)
    noise = np.random.default_rng(0).normal(0, 0.02, pixels.shape)
    image = Image((pixels / 255 + noise).clip(0, 1).astype(np.float32), np.ones(pixels.shape[:2], bool))
    step, (x, y) = 16 / size.unit_px, size.middle
    draw = Draw(
        Affine(j=step, constant=(8 - x) / size.unit_px), Affine(i=step, constant=(8 - y) / size.unit_px)
    )
    inner = For("j", Affine(), Affine(constant=columns), draw)
    return image, Program(CameraPose(), For("i", Affine(), Affine(constant=rows), inner))
