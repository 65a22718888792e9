"""A hole and what each way put into it, side by side at full size, to be looked at by eye."""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

_LEAST_MARGIN_PX = 24
_WIDEST_PX = 3000
_TITLE_PX = 18
_GAP_PX = 6
_GAIN = 2.0


def write_sheet(path: Path, truth: np.ndarray, hole: np.ndarray, filled: Mapping[str, np.ndarray]) -> None:
    """A PNG: photo, hidden, the fill of each method, how far each is off (twice as strong, black is nothing).

    Pictures float [H, W, 3] in 0..255, `hole` bool [H, W]; half the hole's own size around it is shown.
    """
    rows, columns = np.nonzero(hole)
    around = []
    for at, length in ((rows, hole.shape[0]), (columns, hole.shape[1])):
        margin = max(_LEAST_MARGIN_PX, int(at.max() - at.min()) // 2)
        around.append(slice(max(0, int(at.min()) - margin), min(length, int(at.max()) + 1 + margin)))
    here = tuple(around)
    hidden = np.where(hole[:, :, None], 0, truth)
    tiles = [_titled("photo", truth[here]), _titled("hidden", hidden[here])]
    tiles += [_titled(name, pixels[here]) for name, pixels in filled.items()]
    tiles += [_titled(f"{name} - photo", _GAIN * np.abs(p[here] - truth[here])) for name, p in filled.items()]
    across = max(1, min(len(filled) + 2, _WIDEST_PX // tiles[0].shape[1]))
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % across)
    sheet = np.vstack([np.hstack(tiles[k : k + across]) for k in range(0, len(tiles), across)])
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), sheet[:, :, ::-1]):
        raise OSError(f"{path} could not be written")


def _titled(title: str, pixels: np.ndarray) -> np.ndarray:
    values = np.rint(pixels.clip(0, 255)).astype(np.uint8)
    tile = np.full((values.shape[0] + _TITLE_PX + _GAP_PX, values.shape[1] + _GAP_PX, 3), 255, np.uint8)
    tile[_TITLE_PX : _TITLE_PX + values.shape[0], : values.shape[1]] = values
    cv2.putText(tile, title, (1, _TITLE_PX - 5), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 0, 0), 1, cv2.LINE_AA)
    return tile
