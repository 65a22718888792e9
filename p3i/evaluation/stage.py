"""What surrounds the objects of rendered rings: ground, plates, things in the way, light, lens and file.

Convention: pictures are RGB float32 [H, W, 3] in 0..1, painted in place; plane coordinates are program units.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from p3i.evaluation.looks import Random, random_colour
from p3i.paint.draw.view import View
from p3i.vision.decode import decode, swap_red_blue


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate:
    """A round plate on the plane, below the objects: `edges` are the radii where its colour changes."""

    center: tuple[float, float]
    edges: tuple[float, ...]
    """From the outside to the inside."""
    spokes: int = 0
    """Lines from the innermost edge to the outermost one."""
    spoke_phase_deg: float = 0.0


def muted(canvas: np.ndarray, random: Random) -> np.ndarray:
    """The ground in quieter colours: most real ones are."""
    grey = canvas.mean(axis=2, keepdims=True)
    return grey + float(random.uniform(0.25, 0.9)) * (canvas - grey)


def add_plates(canvas: np.ndarray, view: View, plates: Sequence[Plate], random: Random) -> None:
    """Paint plates of one kind onto the plane, in colours that differ from the ground's."""
    base = _colour_apart(random, canvas.mean(axis=(0, 1)), least=15)
    tones = [base if step % 2 == 0 else base * random.uniform(0.7, 1.25) for step in range(8)]
    ink = base * random.choice([0.45, 1.5])
    for plate in plates:
        _add_plate(canvas, view, plate, np.clip(tones, 0, 1), np.clip(ink, 0, 1))


def _add_plate(canvas: np.ndarray, view: View, plate: Plate, tones: np.ndarray, ink: np.ndarray) -> None:
    x, y, pixel = _plane(view)
    x, y = x - plate.center[0], y - plate.center[1]
    radius = np.hypot(x, y)
    for edge, tone in zip(plate.edges, tones, strict=False):
        cover = np.clip(0.5 + (edge - radius) / pixel, 0, 1)[..., None]
        canvas += (cover * (tone - canvas)).astype(np.float32)
    if plate.spokes:
        step_deg = 360 / plate.spokes
        angle = np.degrees(np.arctan2(y, x)) - plate.spoke_phase_deg
        away = np.radians(np.abs((angle + step_deg / 2) % step_deg - step_deg / 2)) * radius
        wide = 0.006 * plate.edges[0] + 0.25
        cover = np.clip(0.5 + (wide - away) / pixel, 0, 1)
        cover *= (radius < plate.edges[0]) & (radius > plate.edges[-1])
        canvas += (cover[..., None] * (ink - canvas)).astype(np.float32)


def add_patches(canvas: np.ndarray, random: Random, count: int) -> None:
    """Paint things that belong to no pattern: ellipses, blocks, triangles and strips."""
    for _ in range(count):
        _add_patch(canvas, random, None, random.uniform(0.03, 0.12))


def add_obstacle(canvas: np.ndarray, random: Random, center_px: np.ndarray, reach_px: float) -> np.ndarray:
    """Paint one thing over `center_px`, about `reach_px` wide, and return what it covers, bool [H, W]."""
    return _add_patch(canvas, random, center_px, reach_px / max(canvas.shape[:2]))


def _add_patch(canvas: np.ndarray, random: Random, center_px: np.ndarray | None, share: float) -> np.ndarray:
    height, width = canvas.shape[:2]
    middle = random.uniform((0, 0), (width, height)) if center_px is None else center_px
    reach = share * max(height, width)
    turn, squeeze = random.uniform(0, 2 * np.pi), random.uniform(0.5, 1)
    corners = int(random.choice([3, 4, 4, 40]))
    angles = turn + 2 * np.pi * np.arange(corners) / corners
    outline = np.column_stack([np.cos(angles), squeeze * np.sin(angles)]) * reach
    lean = random.uniform(0, np.pi)
    axes = np.array([[np.cos(lean), np.sin(lean)], [-np.sin(lean), np.cos(lean)]])
    points = np.rint((middle + outline @ axes) * 16).astype(np.int32)
    mask = np.zeros((height, width), np.float32)
    cv2.fillPoly(mask, [points], 1.0, cv2.LINE_AA, 4)
    cover = mask[..., None]
    shade = 1 + random.uniform(-0.15, 0.15) * np.linspace(-1, 1, width, dtype=np.float32)[None, :, None]
    canvas += cover * (random_colour(random) * shade - canvas)
    return mask > 0.5


def shone_on(canvas: np.ndarray, random: Random) -> np.ndarray:
    """The picture under light that changes across it."""
    height, width = canvas.shape[:2]
    light = 1 + random.uniform(-0.25, 0.25) * np.linspace(-1, 1, width)[None, :, None]
    light = light + random.uniform(-0.25, 0.25) * np.linspace(-1, 1, height)[:, None, None]
    return canvas * light.astype(np.float32)


def photographed(
    canvas: np.ndarray, random: Random, *, noise: float, squeezed: bool
) -> tuple[np.ndarray, bytes | None]:
    """The picture as a camera gives it: blurred, noisy, uint8 [H, W, 3]; and as JPEG if `squeezed`."""
    canvas = cv2.GaussianBlur(canvas, (0, 0), random.uniform(0.4, 0.9))
    canvas = canvas + random.normal(0, noise, canvas.shape).astype(np.float32)
    pixels = np.rint(np.clip(canvas, 0, 1) * 255).astype(np.uint8)
    if not squeezed:
        return pixels, None
    quality = int(random.integers(60, 93))
    _, packed = cv2.imencode(".jpg", swap_red_blue(pixels), [cv2.IMWRITE_JPEG_QUALITY, quality])
    read = decode(packed.tobytes(), name="the scene", max_px=pixels.size).pixels
    return np.rint(read * 255).astype(np.uint8), packed.tobytes()


def beneath(canvas: np.ndarray, places_px: np.ndarray) -> np.ndarray:
    """The colours around places of the picture, Lab [N, 3]."""
    height, width = canvas.shape[:2]
    columns, rows = np.clip(np.rint(places_px).astype(int), 0, (width - 1, height - 1)).T
    return lab(cv2.blur(canvas, (7, 7))[rows, columns])


def lab(colours: np.ndarray) -> np.ndarray:
    """RGB in 0..1, [N, 3], as Lab: distances of 10 are seen at once."""
    return cv2.cvtColor(np.clip(colours, 0, 1).astype(np.float32)[None], cv2.COLOR_RGB2LAB)[0]


def stands_out(look: np.ndarray, ground: np.ndarray, *, least: float) -> bool:
    """Whether a sprite (RGBA [S, S, 4]) differs from most Lab colours [N, 3] that it will lie on.

    By `least` in all, and by a third of it in lightness: colour alone is hard to see.
    """
    weight = look[..., 3:]
    mean = (look[..., :3] * weight).sum(axis=(0, 1)) / weight.sum()
    apart = lab(mean[None]) - ground
    seen = (np.linalg.norm(apart, axis=1) >= least) & (np.abs(apart[:, 0]) >= least / 3)
    return bool(seen.mean() >= 0.8)


def _plane(view: View) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x and y of the plane at each pixel, and how wide a pixel is there, all [H, W].

    Beyond the horizon they are far off.
    """
    matrix = np.linalg.inv(view.canvas_from_plane)
    columns, rows = np.arange(view.size.width)[None, :], np.arange(view.size.height)[:, None]
    x, y, depth = (part[0] * columns + part[1] * rows + part[2] for part in matrix)
    sees = depth > 1e-9
    depth = np.where(sees, depth, 1)
    x, y = np.where(sees, x / depth, 1e6), np.where(sees, y / depth, 1e6)
    across = np.hypot(np.gradient(x, axis=1), np.gradient(y, axis=1))
    down = np.hypot(np.gradient(x, axis=0), np.gradient(y, axis=0))
    return x, y, np.clip(np.sqrt(across * down), 1e-6, 10).astype(np.float32)


def _colour_apart(random: Random, other: np.ndarray, *, least: float) -> np.ndarray:
    """A colour that differs from `other` (RGB [3]) by `least` in Lab, or the best of some tries."""
    tries = np.array([random_colour(random) for _ in range(12)])
    apart = np.linalg.norm(lab(tries) - lab(other[None]), axis=1)
    enough = np.flatnonzero(apart >= least)
    return tries[enough[0] if len(enough) else int(apart.argmax())]
