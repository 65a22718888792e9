"""How many threads the numeric libraries may use."""

import cv2
import torch


def limit_threads(count: int = 1) -> None:
    """Let OpenCV and torch use `count` threads each; 1, the sane default at our sizes, means no pool at all.

    Their pools spin against each other: the same photo was measured at 3 CPU seconds with one thread and
    27 with several on two busy cores (DESIGN.md, section 4). numpy's BLAS reads its limit from the
    environment when it is loaded, so nothing in p3i.vision multiplies large matrices through numpy.
    Raises ValueError for a count below 1.
    """
    if count < 1:
        raise ValueError(f"at least one thread is needed, not {count}")
    cv2.setNumThreads(count)
    torch.set_num_threads(count)
