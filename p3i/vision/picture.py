"""A finished picture with all that its file holds: depth, transparency, colour profile, EXIF, resolution."""

import dataclasses
from dataclasses import dataclass
from os import PathLike

import numpy as np

from p3i.errors import UsageError
from p3i.files import write_bytes
from p3i.size import Size
from p3i.vision.exif import reframed_exif
from p3i.vision.image import Image
from p3i.vision.picture_kinds import PICTURE_KINDS, picture_kind
from p3i.vision.strips import strips_of
from p3i.vision.tiff import has_tifffile
from p3i.vision.write import encode

_WITHOUT_ALPHA = {"jpg"}


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """`values` uint8 or uint16 [H, W, 3] RGB; `alpha` likewise [H, W], None where everything is known."""

    values: np.ndarray
    alpha: np.ndarray | None = None
    icc: bytes | None = None
    exif: bytes | None = None
    dpi: float | None = None

    @property
    def size(self) -> Size:
        return Size(self.values.shape[1], self.values.shape[0])

    @property
    def bits(self) -> int:
        """The depth of a channel: 8 or 16."""
        return 8 * self.values.dtype.itemsize

    def notes(self, kind: str) -> tuple[str, ...]:
        """What a file of `kind` loses, a sentence each."""
        found: list[str] = []
        if self.alpha is not None and kind in _WITHOUT_ALPHA:
            found.append("JPEG keeps no transparency: what is not known is white")
        if self.bits == 16 and kind not in ("png", "tiff"):
            found.append(f"{kind.upper()} keeps 8 of 16 bits: write PNG or TIFF for all of them")
        if self.bits == 16 and kind == "tiff" and (self.exif or self.icc or self.dpi) and not has_tifffile():
            found.append(
                "a TIFF of 16 bits is written without EXIF, colour profile and resolution:"
                " pip install 'p3i[tiff]', or write PNG, to keep them"
            )
        return tuple(found)

    def encode(self, kind: str) -> bytes:
        """The bytes of a file of `kind` (png, jpg, tiff or webp); raises UsageError for another."""
        if kind not in PICTURE_KINDS:
            raise UsageError(f"p3i writes {', '.join(PICTURE_KINDS)}, not {kind!r}")
        values, alpha = self.values, self.alpha
        if alpha is not None and kind in _WITHOUT_ALPHA:
            values, alpha = _on_white(values, alpha), None
        return encode(
            values,
            kind=f".{kind}",
            alpha=alpha,
            bits=self.bits,
            icc=self.icc,
            exif=self.exif,
            dpi=self.dpi,
        )

    def save(self, path: str | PathLike[str], *, kind: str | None = None, force: bool = False) -> None:
        """Write a file, whole or not at all, its kind by the suffix unless `kind` says; `-` is stdout.

        Raises UsageError for an unknown kind, FileError where `path` exists (without `force`) or cannot be
        written.
        """
        write_bytes(path, self.encode(kind or picture_kind(path)), force=force)


def depth(photo: Image) -> int:
    """The bits of a channel that an answer in kind has: 8, or 16 for whatever held more."""
    return 8 if photo.source.bits == 8 else 16


def opacity(photo: Image) -> np.ndarray | None:
    """The photo's plain alpha, float32 [H, W] in 0..1; None where all is known and opaque."""
    alpha = photo.source.alpha
    if alpha is not None and alpha.shape == photo.valid.shape:
        return alpha
    return None if photo.valid.all() else photo.valid.astype(np.float32)


def repainted(photo: Image, pixels: np.ndarray, *, alpha: np.ndarray | None) -> Picture:
    """Pixels float [H, W, 3] in 0..1 as a picture in the photo's depth, with its profile and EXIF.

    `alpha` is float [H, W] in 0..1; None, or 1 everywhere, leaves it out.
    """
    top = 2 ** depth(photo) - 1
    kind = np.uint8 if top == 255 else np.uint16
    if alpha is not None and (alpha == 1).all():
        alpha = None
    values = np.empty(pixels.shape, kind)
    for rows in strips_of(len(pixels)):
        values[rows] = np.rint(pixels[rows].clip(0, 1) * top)
    return Picture(
        values,
        None if alpha is None else np.rint(alpha * top).astype(kind),
        photo.source.icc,
        photo.source.exif,
    )


def reframed(picture: Picture, *, focal_mm: float | None) -> Picture:
    """A picture of another view of its photo: the EXIF speaks of this one, whose focal is `focal_mm`.

    None is a view that no camera has, or that of a camera whose focal nobody knows.
    """
    if picture.exif is None:
        return picture
    return dataclasses.replace(picture, exif=reframed_exif(picture.exif, picture.size, focal_mm=focal_mm))


def _on_white(values: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Values [H, W, 3] laid on white by alpha [H, W], both of one depth."""
    top = np.iinfo(values.dtype).max
    share = alpha.astype(np.float32)[:, :, None] / top
    return np.rint(values * share + top * (1 - share)).astype(values.dtype)
