"""Programs as pictures: alone, over their photo, or straightened; with dots, cells, or pictures."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from p3i.errors import FileError, UsageError
from p3i.files import write_bytes
from p3i.grammar.ast import Program
from p3i.grammar.printer import format_program
from p3i.interp.camera import Camera
from p3i.interp.compile import compile
from p3i.interp.degenerate import FAR, refuse_edge_on
from p3i.interp.unroll import distinct, nest, points
from p3i.marks import PNG_KEYWORD
from p3i.options.render import KINDS, RenderOptions, kind_of
from p3i.paint.draw import scene
from p3i.paint.draw.bent import bent
from p3i.paint.draw.pdf import pdf
from p3i.paint.draw.photo import photo_layer, scaled
from p3i.paint.draw.raster import paint
from p3i.paint.draw.sprite import lay, sprite_of
from p3i.paint.draw.svg import svg
from p3i.paint.draw.view import (
    AUTO_PX,
    View,
    camera_view,
    fitted_camera_view,
    straight_view,
)
from p3i.place import outlines
from p3i.place.lens import bent_points
from p3i.place.placed import FocalSource, camera_of
from p3i.records import changed
from p3i.size import Size, refuse_huge
from p3i.vision.image import Image, read_image
from p3i.vision.write import encode

Path_ = str | PathLike[str]

_DOT_SHARE, _PHOTO_DOT_SHARE = 0.2, 0.11
"""A dot's radius as a share of the spacing; over a photo it should leave the object to be seen."""

_SPRITE_SHARE = 0.9
"""A sprite's longer side as a share of the spacing."""


@dataclass(frozen=True, slots=True, eq=False)
class RenderedPicture:
    """A drawn program, ready to become a file of any kind.

    `camera` is the one that it was drawn with, `focal_source` says where its focal comes from; `centers_px`
    [M, 2] are the objects on the canvas (nan where they are not in front of the camera), `index` [M, 2]
    their (i, j); `notes` are sentences for the user.
    """

    scene: scene.Scene
    program: Program
    camera: Camera
    focal_source: FocalSource
    centers_px: np.ndarray
    index: np.ndarray
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> Size:
        """The canvas."""
        return self.scene.size

    def pixels(self) -> np.ndarray:
        """The picture as uint8 [H, W, 3] RGB, or [H, W, 4] with plain alpha over a transparent photo."""
        return paint(self.scene)

    def encode(self, kind: str) -> bytes:
        """The bytes of a file of `kind` (png, svg or pdf); PNG and SVG carry the program's text.

        Raises UsageError for another kind.
        """
        text = format_program(self.program)
        if kind == "svg":
            return svg(self.scene, program_text=text).encode("utf-8")
        if kind == "pdf":
            return pdf(self.scene)
        if kind != "png":
            raise UsageError(f"p3i draws {', '.join(KINDS)}, not {kind!r}")
        values = self.pixels()
        alpha = values[:, :, 3].astype(np.float32) / 255 if values.shape[2] == 4 else None
        colours = np.ascontiguousarray(values[:, :, :3])
        return encode(colours, kind=".png", alpha=alpha, text={PNG_KEYWORD: text})

    def record(self) -> dict[str, Any]:
        """The facts as plain JSON values: the canvas, the camera (degrees, mm), the objects, the program."""
        seen = np.isfinite(self.centers_px).all(axis=1)
        return {
            "size": [self.size.width, self.size.height],
            "camera": {
                "rx": self.camera.rx_deg,
                "ry": self.camera.ry_deg,
                "focal": self.camera.focal_mm,
                "focal_from": self.focal_source,
            },
            "objects": int(seen.sum()),
            "program": format_program(self.program),
        }

    def save(self, path: Path_, *, kind: str | None = None, force: bool = False) -> None:
        """Write a file, whole or not at all, its kind by the suffix unless `kind` says; `-` is stdout.

        Raises UsageError for an unknown kind, FileError where `path` exists (without `force`) or cannot be
        written.
        """
        write_bytes(path, self.encode(kind or kind_of(path)), force=force)


def render(
    program: Program,
    options: RenderOptions | None = None,
    *,
    image: Path_ | Image | None = None,
    sprite: Path_ | Image | None = None,
    beside: Path_ | None = None,
    named_pictures: bool = True,
    **changes: Any,
) -> RenderedPicture:
    """Draw a program: dots coloured by loop index, cells, horizon, or a picture at each object.

    With `image` the drawing goes over that photo; with `plane` the plane is seen straight on (and the photo
    straightened). `sprite` stands at every object, flat on the plane, and wins over the picture named in
    `Draw`, which is looked up in the folder `beside` (the working folder), unless `named_pictures` is False.
    `changes` are fields of RenderOptions. Raises FileError for pictures that cannot be read, ProgramError
    where the plane is seen edge-on, UsageError for options that cannot be.
    """
    options = changed(options or RenderOptions(), changes, verb="render")
    folder = Path(beside or ".")
    photo = read_image(image) if isinstance(image, str | PathLike) else image
    camera, focal_source = camera_of(program, photo, focal_mm=options.focal_mm)
    if not options.plane or photo is not None:
        refuse_edge_on(camera)

    pictures = None
    if named_pictures or sprite is not None:
        pictures = _sprite(program, sprite, folder, allow_outside=options.allow_outside)
    # Numbers of any size may stand in a program; what overflows around an object is left out.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        objects = _objects(program)
        around = outlines.surroundings(objects.chart, objects.index)
        view = _view(program, options, camera, photo, around)
        if photo is not None and options.size is not None and not options.plane:
            photo = scaled(photo, options.size)
        k1 = program.header.lens_k1 if program.header else None
        ground: tuple[scene.Layer, ...] = ()
        if photo is not None:
            ground = (scene.Pixels(photo_layer(photo, view, k1=k1)),)
        layers = ground + _layers(objects, view, options, over_photo=photo is not None, pictures=pictures)
        centers_px, depth = view.project(objects.points)
        if k1 and not options.plane and _canvas(program, options, photo) is not None:
            layers = ground + tuple(bent(layer, view.size, k1) for layer in layers[len(ground) :])
            centers_px, _ = bent_points(centers_px, view.size, k1)
    transparent = any(isinstance(layer, scene.Pixels) and layer.values.shape[2] == 4 for layer in ground)
    return RenderedPicture(
        scene.Scene(view.size, None if transparent else scene.WHITE, layers),
        program,
        camera,
        focal_source,
        centers_px,
        objects.index,
        _notes(photo, depth, too_far=objects.too_far),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Objects:
    """What a program draws: `points` [M, 2] in program units, `index` [M, 2]; far ones are counted only."""

    chart: outlines.Chart
    points: np.ndarray
    index: np.ndarray
    loops: int
    too_far: int


def _objects(program: Program) -> _Objects:
    found = points(program)
    near = [place for place in found if abs(place[0]) < FAR and abs(place[1]) < FAR]
    # Coinciding draws are one object: painted twice, what is half transparent would not be.
    kept = [near[place] for place in distinct(near)]
    chart = outlines.chart_of(compile(program))
    parts = nest(program)
    return _Objects(
        chart,
        np.array([place[:2] for place in kept], dtype=np.float64).reshape(-1, 2),
        np.array([place[2:] for place in kept], dtype=np.int64).reshape(-1, 2),
        (parts.for_i is not None) + (parts.for_j is not None),
        len(found) - len(near),
    )


def _layers(
    objects: _Objects, view: View, options: RenderOptions, *, over_photo: bool, pictures: Image | None
) -> tuple[scene.Layer, ...]:
    """All that is painted on paper or over a photo, from the ground up."""
    spacing = outlines.pitch(objects.chart)
    bare = not over_photo and pictures is None
    layers: list[scene.Layer] = []
    if options.cells if options.cells is not None else bare:
        layers += scene.grid(view, outlines.sides(objects.chart, objects.index), over_photo=not bare)
    if pictures is not None:
        units = options.sprite_units or _SPRITE_SHARE * spacing
        layers.append(scene.Pixels(lay(view, [sprite_of(pictures)], objects.points, units=units)))
    if options.horizon:
        layers += scene.horizon(view, over_photo=over_photo)
    if options.markers if options.markers is not None else pictures is None:
        colours = scene.colours_of(objects.index, loops=objects.loops)
        radius = (_PHOTO_DOT_SHARE if over_photo else _DOT_SHARE) * spacing
        layers.append(scene.dots(view, objects.points, radius=radius, colours=colours, light_rim=over_photo))
    return tuple(layers)


def _canvas(program: Program, options: RenderOptions, photo: Image | None) -> Size | None:
    """The canvas: by the option, then the photo, then the header; None where nobody says."""
    if options.size is not None:
        return options.size
    if photo is not None:
        return photo.size
    if program.header is not None and program.header.canvas is not None:
        return Size(*program.header.canvas)
    return None


def _view(
    program: Program, options: RenderOptions, camera: Camera, photo: Image | None, cells: np.ndarray
) -> View:
    canvas = _canvas(program, options, photo)
    if canvas is not None:
        refuse_huge(canvas, max_px=options.max_px)
    if options.plane:
        longer = canvas.longer if canvas is not None else AUTO_PX
        view = straight_view(camera, cells, size=options.size, longer=longer)
    elif canvas is not None:
        view = camera_view(camera, canvas)
    else:
        view = fitted_camera_view(camera, cells)
    refuse_huge(view.size, max_px=options.max_px)
    return view


def _sprite(
    program: Program, sprite: Path_ | Image | None, folder: Path, *, allow_outside: bool
) -> Image | None:
    """The picture that stands at the objects: the one given, else the one that `Draw` names.

    A program may come from anybody: what it names is read from below its folder only, links followed.
    """
    if isinstance(sprite, Image):
        return sprite
    if sprite is not None:
        return read_image(sprite)
    named = nest(program).draw.picture
    if named is None:
        return None
    try:
        place = (folder / named).resolve()
        if not allow_outside and not place.is_relative_to(folder.resolve()):
            raise FileError(
                f"{named} lies outside the program's folder; --allow-outside reads it all the same "
                "(allow_outside in Python)"
            )
        if place.exists() and not place.is_file():
            raise FileError(f"{named} is no file with a picture")  # a pipe would be waited for, for ever
        return read_image(place)
    except (OSError, RuntimeError, ValueError) as error:  # links in a circle, a name that no system takes
        raise FileError(f"the picture of Draw(...): {named} cannot be found: {error}") from None
    except FileError as error:
        raise FileError(f"the picture of Draw(...): {error}") from None


def _notes(photo: Image | None, depth: np.ndarray, *, too_far: int) -> tuple[str, ...]:
    notes: list[str] = list(photo.notes) if photo is not None else []
    if too_far:
        notes.append(f"{too_far} objects lie more than {FAR:,.0f} units away and are not drawn")
    elif not len(depth):
        notes.append("the program draws nothing")
    if behind := int((depth <= 0).sum()):
        notes.append(f"{behind} of {len(depth)} objects lie at or behind the camera and are not drawn")
    return tuple(notes)
