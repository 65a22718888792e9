"""The photo that a program is drawn over, as a layer of the picture."""

import dataclasses

import cv2
import numpy as np

from p3i.errors import UsageError
from p3i.paint.draw.sprite import in_front, plain, premultiplied
from p3i.paint.draw.view import View
from p3i.place.flat import laid_flat
from p3i.size import Size
from p3i.vision.image import Image, resized, resized_from_photo
from p3i.vision.warp import warp_pixels


def scaled(photo: Image, size: Size) -> Image:
    """The photo in another size; raises UsageError where its shape would have to change."""
    if size == photo.size:
        return photo
    across, down = size.width / photo.size.width, size.height / photo.size.height
    if abs(across - down) * photo.size.longer > 1.01:
        raise UsageError(
            f"--size {size.width}x{size.height} would distort the photo, which has "
            f"{photo.size.width}x{photo.size.height}"
        )
    how = cv2.INTER_AREA if across < 1 else cv2.INTER_CUBIC
    values = cv2.resize(_rgba(photo), (size.width, size.height), interpolation=how)
    values = plain(np.clip(values, 0, 1)).astype(np.float32) / 255
    source = dataclasses.replace(photo.source, alpha=np.ascontiguousarray(values[:, :, 3]))
    colours = np.ascontiguousarray(values[:, :, :3])
    return Image(colours, values[:, :, 3] >= 0.5, photo.focal_mm, source, photo.notes)


def photo_layer(photo: Image, view: View, *, k1: float | None) -> np.ndarray:
    """The photo on the canvas, straightened where the view is: uint8 [H, W, 3], or 4 if parts are missing.

    A straight view undoes the lens too.
    """
    if not view.plane:
        values = plain(_rgba(photo))
        return np.ascontiguousarray(values[:, :, :3]) if (values[:, :, 3] == 255).all() else values
    plane_from_canvas = np.linalg.inv(view.canvas_from_plane)
    photo_from_plane = view.camera.image_from_plane(photo.size).numpy()
    if k1:
        photo, _, (left, top) = laid_flat(photo, k1)
        photo_from_plane = np.array([[1.0, 0, left], [0, 1, top], [0, 0, 1]]) @ photo_from_plane
    # Reduce the photo first where the straight view is smaller, or fine texture would flicker.
    photo_from_canvas = photo_from_plane @ plane_from_canvas
    middle = photo_from_canvas @ np.array([*view.size.middle, 1])
    density = np.linalg.det(photo_from_canvas) / max(float(middle[2]), 1e-6) ** 3
    shrink = float(np.sqrt(max(density, 1e-12)))
    if shrink > 1.3:
        small = resized(photo, max(1, round(photo.size.longer / shrink)))
        photo_from_plane = resized_from_photo(small.size.longer / photo.size.longer) @ photo_from_plane
        photo = small
    photo_from_canvas = photo_from_plane @ plane_from_canvas
    padded = np.pad(_rgba(photo), ((1, 1), (1, 1), (0, 0)))  # transparent all around
    padded_from_photo = np.array([[1.0, 0, 1], [0, 1, 1], [0, 0, 1]])
    values = warp_pixels(padded, padded_from_photo @ photo_from_canvas, view.size)
    return plain(values * in_front(photo_from_canvas, view.size)[:, :, None])


def _rgba(photo: Image) -> np.ndarray:
    """The photo, premultiplied; what is unknown without being transparent counts as transparent."""
    alpha = photo.source.alpha
    if alpha is None or alpha.shape != photo.valid.shape:
        alpha = photo.valid.astype(np.float32)
    return premultiplied(photo.pixels, alpha)
