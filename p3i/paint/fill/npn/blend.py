"""Two fills of a hole as one: so much of the network's, and as sharp as the stack's.

A mean of two fills comes nearer to what is hidden than either where their errors differ, and is softer than
both where their detail does. Its own detail is made stronger, then, until the steps between neighbours are as
large as the stack's (unsharp masking): what both agree on is more likely there than what either shows alone.

Convention: photos float32 RGB [H, W, 3] in 0..1; masks bool [H, W].
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.paint.fill.mixing import share_to_reach

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

# Detail is finer than so many pixels, as the stack's grain is (fill/mixing.py).
_FINE_PX = 1.5
# It is made so many times as strong at most: then edges have halos.
_MOST_STRONGER = 1.5


def blended(stack: Floats, network: Floats, where: Mask, share: float) -> Floats:
    """The `stack`'s photo [H, W, 3] with this share (0..1) of the `network`'s `where` [H, W] it differs.

    There it is as sharp as the stack's is, if it can be.
    """
    result = stack.copy()
    if not where.any():
        return result
    left, top, wide, high = cv2.boundingRect(where.astype(np.uint8))
    window = (slice(top, top + high), slice(left, left + wide))
    own, inside = stack[window], where[window]
    mixed = own + np.float32(share) * np.where(inside[..., None], network[window] - own, np.float32(0))
    weight = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), _FINE_PX)[..., None]
    blurred = cv2.GaussianBlur(mixed * inside[..., None], (0, 0), _FINE_PX)
    fine = (mixed - blurred / np.maximum(weight, 1e-6)).astype(np.float32)
    mixed += np.float32(_stronger(mixed, fine, inside, energy=_energy(own, own, inside))) * fine
    result[window] = np.where(inside[..., None], np.clip(mixed, 0, 1), own)
    return result


def _stronger(mixed: Floats, fine: Floats, inside: Mask, *, energy: float) -> float:
    """How much of `fine` to add to `mixed` [h, w, 3] to give it this energy inside; 0 where it has more."""
    plain, both, square = (_energy(*pair, inside) for pair in ((mixed, mixed), (mixed, fine), (fine, fine)))
    return min(share_to_reach(energy, plain, both, square), _MOST_STRONGER - 1)


def _energy(one: Floats, other: Floats, inside: Mask) -> float:
    """The products of two pictures' steps [h, w, 3] between neighbours, summed where both are inside."""
    found = 0.0
    for later, earlier in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        pairs = inside[later] & inside[earlier]
        steps = [(picture[later] - picture[earlier])[pairs] for picture in (one, other)]
        found += float((steps[0].astype(float) * steps[1]).sum())
    return found
