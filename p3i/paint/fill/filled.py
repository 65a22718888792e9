"""What a way to fill a hole hands back, whichever way it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class Filled:
    """A photo float32 [H, W, 3] in 0..1 with its hole filled, and where that was done otherwise than asked.

    `unlike` [H, W] says for which pixels of the hole the program shows nothing like them, `fallback` [H, W]
    where something simpler than the method filled them, these among them; `notes` are sentences on why.
    """

    pixels: NDArray[np.float32]
    unlike: NDArray[np.bool_]
    fallback: NDArray[np.bool_]
    notes: tuple[str, ...] = ()


def share_text(part: NDArray[np.bool_], hole: NDArray[np.bool_]) -> str | None:
    """How much of a hole [H, W] a part of it is, as "12% of the hole"; None for less than a hundredth."""
    share = float((part & hole).sum() / max(1, hole.sum()))
    return f"{share:.0%} of the hole" if share >= 0.01 else None
