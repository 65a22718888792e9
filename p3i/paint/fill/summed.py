"""A large picture that many windows add to, strip by strip: only the rows that are being added to are held.

Convention: pictures [H, W, 3] float32; a window is its rows and columns.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from p3i.vision.planes import times
from p3i.vision.strips import ROWS, Window

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Some `rows` of a picture as the sum of what was added to it: `total` [h, W, 3], `weight` [h, W]."""

    rows: slice
    total: Floats
    weight: Floats


def summed(shape: tuple[int, int], added: Iterable[tuple[Window, tuple[Floats, Floats]]]) -> Iterator[Strip]:
    """The sums of what is `added`, those rows of a picture [H, W] that anything is added to, from the top.

    Each adds colours [h, w, 3], times their weights [h, w], in its window. None begins above one before it.
    """
    height, width = shape
    open_: dict[int, Strip] = {}

    def opened(number: int) -> Strip:
        if number not in open_:
            rows = slice(number * ROWS, min(height, (number + 1) * ROWS))
            size = (rows.stop - rows.start, width)
            open_[number] = Strip(rows, np.zeros((*size, 3), np.float32), np.zeros(size, np.float32))
        return open_[number]

    for (rows, columns), (colours, weights) in added:
        done = [number for number in sorted(open_) if (number + 1) * ROWS <= rows.start]
        yield from (open_.pop(number) for number in done)
        colours = times(weights, colours)
        for number in range(rows.start // ROWS, -(-rows.stop // ROWS)):
            strip = opened(number)
            first, last = max(rows.start, strip.rows.start), min(rows.stop, strip.rows.stop)
            to = slice(first - strip.rows.start, last - strip.rows.start)
            of = slice(first - rows.start, last - rows.start)
            strip.total[to, columns] += colours[of]
            strip.weight[to, columns] += weights[of]
    yield from (open_[number] for number in sorted(open_))
