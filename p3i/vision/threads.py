"""How many threads the numeric libraries may use, and for how long."""

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import torch


def limit_threads(count: int = 1) -> None:
    """Let OpenCV and torch use `count` threads each from now on, in a process of one's own.

    Their pools spin against each other: the same photo was measured at 3 CPU seconds with one thread and
    27 with several on two busy cores (DESIGN.md, section 4). numpy's BLAS reads its limit from the
    environment when it is loaded, so nothing in p3i.vision multiplies large matrices through numpy.
    Raises ValueError for a count below 1.
    """
    if count < 1:
        raise ValueError(f"at least one thread is needed, not {count}")
    cv2.setNumThreads(count)
    torch.set_num_threads(count)


@contextmanager
def limited_threads(count: int | None = 1) -> Iterator[None]:
    """`limit_threads` as long as the block lasts, then as many as before; None leaves all as it is."""
    before = cv2.getNumThreads(), torch.get_num_threads()
    try:
        if count is not None:
            limit_threads(count)
        yield
    finally:
        cv2.setNumThreads(before[0])
        torch.set_num_threads(before[1])
