"""A photo straightened by its program: the view, what is known of it, and the way back into the photo."""

from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from p3i.grammar.ast import Program
from p3i.options.rectify import RectifyOptions
from p3i.paint.straight.back import back, likeness
from p3i.paint.straight.framing import straightened
from p3i.paint.straight.straightened import Straightened
from p3i.place.placed import placed
from p3i.records import changed
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.picture import Picture, depth, opacity, reframed
from p3i.vision.resample import resample

# An edited view of which more than this differs, or whose light has less to do with the view than this (of a
# JPEG little differs by enough to count), may be another picture.
_MOST_EDITED = 0.8
_LEAST_ALIKE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Rectified:
    """A straightened view, not painted yet: `view` is its geometry, `notes` are sentences for the user.

    `pinhole_from_view` and `view_from_pinhole` of `view` are the homographies; `paint` makes the picture,
    `back` takes an edited one into the photo, `record` is all that is known as JSON.
    """

    photo: Image = field(repr=False)
    program: Program
    view: Straightened
    options: RectifyOptions
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """The canvas of the view."""
        return self.view.size

    def paint(self) -> Picture:
        """The straightened picture, as deep as the photo; transparent where the photo shows nothing.

        Its EXIF names no focal: seen straight on, a plane looks alike through every lens.
        """
        source = self.photo.source
        values, alpha = resample(
            self.photo.pixels, opacity(self.photo), self.view.in_photo, size=self.size, bits=depth(self.photo)
        )
        return reframed(Picture(values, alpha, source.icc, source.exif, self.view.dpi), focal_mm=None)

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Paint and write the view: `Picture.save`."""
        self.paint().save(path, kind=kind, force=force)

    def back(self, edited: Image) -> "Returned":
        """The photo with what was edited in `edited`, this view painted and changed by hand.

        Pixels of the photo whose view did not change keep their value, to the bit. Raises UsageError where
        `edited` has another size than the view.
        """
        painted = self.paint()
        picture, count, share = back(self.photo, self.view, painted, edited, tolerance=self.options.tolerance)
        notes: list[str] = []
        if share > _MOST_EDITED or likeness(painted, edited) < _LEAST_ALIKE:
            notes.append(
                f"{share:.0%} of the edited picture's pixels differ from the view: unless all was edited, "
                "it was made with other options (the program, --crop, --as-seen, --scale, --cell, --focal)"
            )
        return Returned(picture, count, tuple(notes))

    def record(self) -> dict[str, Any]:
        """The geometry as plain JSON values; docs/rectify.md says what each means."""
        view, laid = self.view, self.view.placed
        horizon = laid.camera.horizon(laid.size)
        basis = laid.basis
        turned = None if basis is None else basis @ view.view_from_plane[:2, :2].T
        origin = view.view_from_plane @ np.array([*laid.origin, 1.0])
        return {
            "photo": [laid.size.width, laid.size.height],
            "view": [self.size.width, self.size.height],
            "crop": self.options.crop,
            "scale": _plain(view.scale),
            "photo_from_view": _plain(_scaled(view.pinhole_from_view)),
            "view_from_photo": _plain(_scaled(view.view_from_pinhole)),
            "photo_from_plane": _plain(laid.image_from_plane),
            "view_from_plane": _plain(view.view_from_plane),
            "camera": {
                "rx": _plain(laid.camera.rx_deg),
                "ry": _plain(laid.camera.ry_deg),
                "focal": _plain(laid.camera.focal_mm),
            },
            "normal": _plain(np.array(laid.camera.normal)),
            "horizon": None if horizon is None else _plain(np.array(horizon)),
            "lens_k1": view.k1,
            "origin": _plain(origin[:2]),
            "u": None if turned is None else _plain(turned[0]),
            "v": None if turned is None else _plain(turned[1]),
            "mm_per_px": _plain(view.mm_per_px),
            "px_per_mm": None if view.mm_per_px is None else _plain(1 / view.mm_per_px),
            "dpi": _plain(view.dpi),
        }


@dataclass(frozen=True, slots=True, eq=False)
class Returned:
    """A photo with an edited view put back: the `picture`, and how many of its pixels `changed`.

    `notes` are sentences for the user.
    """

    picture: Picture
    changed: int
    notes: tuple[str, ...] = ()

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write the photo: `Picture.save`."""
        self.picture.save(path, kind=kind, force=force)


def rectify(
    photo: Image, program: Program, options: RectifyOptions | None = None, **changes: Any
) -> Rectified:
    """The straightened view of `photo` by `program`; `changes` are fields of RectifyOptions.

    Raises ProgramError where the program has no object on the photo, UsageError for options that cannot be.
    """
    options = changed(options or RectifyOptions(), changes, verb="rectify")
    laid = placed(program, photo, focal_mm=options.focal_mm)
    k1 = (program.header.lens_k1 if program.header else None) or None
    view, notes = straightened(laid, photo.valid, options, k1=k1)
    return Rectified(photo, program, view, options, (*photo.notes, *notes))


def _scaled(matrix: np.ndarray) -> np.ndarray:
    """A homography so that its last number is 1 where it can be, its sign kept where it cannot."""
    last = matrix[2, 2]
    return matrix / last if last > 1e-9 * np.abs(matrix).max() else matrix / np.abs(matrix).max()


def _plain(value: Any) -> Any:
    """Numbers as JSON knows them, with the digits on which all machines agree."""
    if value is None:
        return None
    array = np.asarray(value, float)
    least = 1e-11 * float(np.abs(array).max(initial=0.0))
    rounded = [0.0 if abs(number) <= least else float(f"{number:.10g}") for number in array.ravel().tolist()]
    return rounded[0] if not array.ndim else np.array(rounded).reshape(array.shape).tolist()
