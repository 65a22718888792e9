"""Unknown pixels: filled from what surrounds them, and kept away from what is known."""

import cv2
import numpy as np


def filled(array: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """The array with its unknown pixels replaced by a smooth continuation of the known ones.

    Shapes: array [H, W, C] float32 with C <= 4, valid bool [H, W] -> [H, W, C]. Push-pull: the known pixels
    are averaged down a pyramid, and what is unknown is read from the coarser levels, mixed by how much they
    know. The values of unknown pixels are never read. Where nothing at all is known the answer is 0.
    """
    if valid.all():
        return array
    weight = valid.astype(np.float32)
    return _push_pull(np.where(valid[:, :, None], array, np.float32(0)), weight)


def fill_in(array: np.ndarray, valid: np.ndarray, where: np.ndarray) -> None:
    """Write `filled` into the array's pixels `where` bool [H, W] that are not valid, in place.

    Channel by channel, and no more than what is needed of each level: a large picture's copies are much.
    """
    height, width = valid.shape
    half = _half(width, height)
    weight = cv2.resize(valid.astype(np.float32), half, interpolation=cv2.INTER_AREA).reshape(half[::-1])
    for channel in range(array.shape[2]):
        plane = array[:, :, channel]
        known = cv2.resize(np.where(valid, plane, np.float32(0)), half, interpolation=cv2.INTER_AREA)
        coarse = _push_pull(known.reshape(half[1], half[0], -1), weight)
        coarse = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)
        np.copyto(plane, coarse.reshape(height, width), where=where & ~valid)


def eroded(valid: np.ndarray, radius: int) -> np.ndarray:
    """Where the whole square of `radius` pixels around is known; beyond the frame nothing is. Bool [H, W]."""
    if radius == 0:
        return valid
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    mask = valid.astype(np.uint8)
    return cv2.erode(mask, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0).astype(bool)  # pyright: ignore[reportCallIssue, reportArgumentType]


def _push_pull(weighted: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """`weighted` is value times weight [H, W, C]; weight in 0..1 [H, W]; returns the value everywhere."""
    value = weighted / np.maximum(weight, 1e-6)[:, :, None]
    height, width = weight.shape
    if weight.min() >= 1 or max(height, width) == 1:
        return value
    half = _half(width, height)
    smaller = cv2.resize(weighted, half, interpolation=cv2.INTER_AREA).reshape(half[1], half[0], -1)
    smaller_weight = cv2.resize(weight, half, interpolation=cv2.INTER_AREA)
    coarse = cv2.resize(_push_pull(smaller, smaller_weight), (width, height), interpolation=cv2.INTER_LINEAR)
    # value where it is known, else coarse + weight * (value - coarse), without further copies.
    coarse = coarse.reshape(value.shape)
    value -= coarse
    value *= weight[:, :, None]
    value += coarse
    np.copyto(value, weighted, where=weight[:, :, None] >= 1)
    return value


def _half(width: int, height: int) -> tuple[int, int]:
    return max(1, (width + 1) // 2), max(1, (height + 1) // 2)
