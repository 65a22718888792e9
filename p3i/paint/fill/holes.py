"""What is to be filled: what a mask marks, the cells of objects, and objects that are to go; and hole by hole
what became of it.

Convention: masks bool [H, W]; boxes are (x, y, width, height) in pixels of the photo.
"""

import dataclasses
import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.points import PointsOptions
from p3i.place.flat import Flat
from p3i.place.objects import Object, objects_of
from p3i.place.placed import Placed, placed
from p3i.vision.image import Image, read_mask

Mask = NDArray[np.bool_]
Named = str | tuple[int, int]

CHANGED = (
    "--remove means another thing since this version: it takes the object away, and ground goes on under it; "
    "what it did before, to fill the object's cell with the pattern, is --restore"
)
"""For one version, the sentence that tells users of an option that it means another thing now."""

# A share of a hole below this is not told of.
_LEAST_TOLD = 0.01
# Straightening a bent photo mixes neighbours: a hole in it is this many pixels wider.
_LENS_MARGIN_PX = 2
_ALL = "the hole takes all of the photo: nothing would be left to fill it from"


@dataclass(frozen=True, slots=True, eq=False)
class Asked:
    """What is to be filled: `hole` [H, W] from the pattern, and the (i, j) of the objects that are to go."""

    hole: Mask
    removed: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class HoleFacts:
    """One hole, what hangs together of all: its size and box, and shares of it in 0..1.

    `unlike` is like nothing that the program shows elsewhere; at the `guess` objects differ so much from one
    another that any fill is one; `rim` is the share of its surroundings where the photo is not what the
    pattern shows, so that something else may run into the hole; `ground` was filled as ground under objects.
    """

    pixels: int
    box: tuple[int, int, int, int]
    unlike: float
    guess: float
    rim: float
    ground: float

    @property
    def note(self) -> str:
        """A sentence on what cannot come from the pattern; empty where all can."""
        said = [
            (self.unlike, "nothing of the pattern is like {}"),
            (self.guess, "the pattern's objects differ too much from one another at {}: a guess"),
        ]
        found = [text.format(f"{share:.0%} of it") for share, text in said if share >= _LEAST_TOLD]
        if self.rim >= _LEAST_TOLD:
            found.append(f"at {self.rim:.0%} of its rim stands what is not of the pattern")
        return "; ".join(found)

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values."""
        facts = dataclasses.asdict(self)
        shares = {name: round(facts[name], 4) for name in ("unlike", "guess", "rim", "ground")}
        return {"pixels": self.pixels, "box": list(self.box), **shares, "note": self.note or None}

    def sentence(self) -> str:
        """Where the hole lies and what cannot come from the pattern."""
        x, y, width, height = self.box
        return f"hole of {width} x {height} px at {x},{y}: {self.note}"


def asked_for(
    photo: Image,
    program: Program,
    *,
    mask: str | PathLike[str] | Mask | None,
    restore: Sequence[Named] = (),
    remove: Sequence[Named] = (),
    focal_mm: float | None = None,
) -> Asked:
    """What is to be filled, bool [H, W], by the arguments of `inpaint`, which says what is raised."""
    hole = _marked(photo, mask)
    listed = _listed(photo, program, focal_mm=focal_mm) if restore or remove else ()
    if restore:
        hole |= _cells([_found(listed, asked) for asked in restore], hole.shape)
    going = [_found(listed, asked) for asked in remove]
    if mask is None and not restore and not remove:
        hole = ~photo.valid
    if not hole.any() and not going:
        raise UsageError(
            "nothing is to be filled: give --mask FILE (white is filled), --restore NAME or --remove NAME"
        )
    if (hole | ~photo.valid).all():
        raise UsageError(_ALL)
    return Asked(hole, tuple(dict.fromkeys((one.i, one.j) for one in going)))


def hidden_ground(
    photo: Image, mask: str | PathLike[str] | Mask | None, *, keep_transparent: bool
) -> tuple[Mask, Mask]:
    """What `mask` hides of a photo, bool [H, W], and all that is to be filled: what is transparent too.

    But that not where it is to stay so. Nothing is hidden without a mask. Raises as `asked_for` does.
    """
    hidden = _marked(photo, mask)
    hole = hidden | ~photo.valid
    if hole.all():
        raise UsageError(_ALL)
    return hidden, hidden if keep_transparent else hole


def on_flat(flat: Flat, hole: Mask) -> Mask:
    """A hole [H, W] of a photo on its flat canvas [h, w].

    A bent photo is filled where it is straight, and the hole's pixels are brought back: around it as much is
    filled as bringing back mixes in, beyond the photo's edge too.
    """
    if flat.k1 is None:
        return hole
    wider = np.ones((2 * _LENS_MARGIN_PX + 1,) * 2, np.uint8)
    return cv2.dilate(flat.marked(hole).astype(np.uint8), wider) > 0


def _marked(photo: Image, mask: str | PathLike[str] | Mask | None) -> Mask:
    """What a mask marks of a photo, bool [H, W], a copy; nothing without one."""
    if isinstance(mask, np.ndarray):
        if mask.shape != photo.valid.shape or mask.dtype != np.bool_:
            raise UsageError(f"a mask is bool {photo.valid.shape}, not {mask.dtype} {mask.shape}")
        return mask.copy()
    return np.zeros(photo.valid.shape, bool) if mask is None else read_mask(mask, photo.size)


def only(laid: Placed, index: Sequence[tuple[int, int]]) -> Placed:
    """The program with some of its objects, those at `index`; the pattern is that of all."""
    wanted = set(index)
    chosen = [place for place, (i, j) in enumerate(laid.index.tolist()) if (i, j) in wanted]
    return dataclasses.replace(laid, index=laid.index[chosen], points=laid.points[chosen])


def facts_of(
    hole: Mask, *, unlike: Mask, guess: Mask, strange: Mask, ground: Mask, reach_px: float
) -> tuple[HoleFacts, ...]:
    """The facts of each hole of a mask [H, W], largest first; `strange` counts up to `reach_px` around."""
    labels, stats = cv2.connectedComponentsWithStats(hole.astype(np.uint8), connectivity=8)[1:3]
    margin = int(np.ceil(reach_px)) + 1
    found: list[HoleFacts] = []
    for label in range(1, len(stats)):
        x, y, width, height, pixels = stats[label].tolist()
        part = (
            slice(max(0, y - margin), y + height + margin),
            slice(max(0, x - margin), x + width + margin),
        )
        inside = labels[part] == label
        away = cv2.distanceTransform((~inside).astype(np.uint8), cv2.DIST_L2, 5)
        rim = (away <= reach_px) & ~hole[part]
        shares = [float((inside & one[part]).sum()) / pixels for one in (unlike, guess, ground)]
        beside = float((rim & strange[part]).sum() / max(1, rim.sum()))
        found.append(HoleFacts(pixels, (x, y, width, height), shares[0], shares[1], beside, shares[2]))
    return tuple(sorted(found, key=lambda one: -one.pixels))


def parse_index(text: str) -> tuple[int, int] | None:
    """`i,j` as two whole numbers; None for anything else."""
    found = re.fullmatch(r"\s*([+-]?\d{1,9})\s*,\s*([+-]?\d{1,9})\s*", text)
    return None if found is None else (int(found[1]), int(found[2]))


def _listed(photo: Image, program: Program, *, focal_mm: float | None) -> tuple[Object, ...]:
    camera = placed(program, photo, focal_mm=focal_mm).camera
    return objects_of(program, None, PointsOptions(size=photo.size, focal_mm=camera.focal_mm)).objects


def _found(listed: Sequence[Object], asked: Named) -> Object:
    """The object of a name or (i, j); raises UsageError for one that is not on the photo."""
    index = parse_index(asked) if isinstance(asked, str) else (asked[0], asked[1])
    name = str(asked).strip().upper()
    for one in listed:
        if (one.name.upper() == name) if index is None else ((one.i, one.j) == index):
            return one
    known = ", ".join([one.name for one in listed[:3]] + (["..."] if len(listed) > 3 else []))
    raise UsageError(
        f"there is no object {asked} on the photo: `p3i points` lists their names ({known}) and i, j"
    )


def _cells(chosen: Sequence[Object], shape: tuple[int, ...]) -> Mask:
    """The cells of objects on the photo, bool [H, W]."""
    hole = np.zeros(shape, np.uint8)
    for one in chosen:
        if one.cell_px:
            # In sixteenths of a pixel, so that the cell's outline is met as closely as pixels allow.
            cv2.fillPoly(hole, [np.rint(np.array(one.cell_px) * 16).astype(np.int32)], 1, shift=4)
    return hole > 0
