"""Pictures and lists made from a photo and its program: `show`, `render`, `rectify`, `inpaint`, ..."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from p3i import files
from p3i.api.search import Progress, doubted, photo_and_program, read_image, without
from p3i.carried import read_either, read_program
from p3i.errors import UsageError
from p3i.grammar.ast import Program
from p3i.options.edit import EditOptions
from p3i.options.extend import ExtendOptions
from p3i.options.inpaint import FindOptions, InpaintOptions
from p3i.options.points import PointsOptions
from p3i.options.rectify import RectifyOptions
from p3i.options.render import RenderOptions
from p3i.options.show import ShowOptions
from p3i.options.tile import TileOptions
from p3i.records import changed
from p3i.search.config import SearchConfig

if TYPE_CHECKING:
    import numpy as np

    from p3i.export.listing import Listing
    from p3i.paint.draw.render import RenderedPicture
    from p3i.paint.edit.edit import Edited
    from p3i.paint.edit.extend import Extended
    from p3i.paint.fill.found import Marred
    from p3i.paint.fill.inpaint import Inpainted
    from p3i.paint.straight.rectify import Rectified
    from p3i.paint.straight.tile import Tile
    from p3i.vision.image import Image


def render(
    program: Program | str | os.PathLike[str],
    options: RenderOptions | None = None,
    *,
    image: "str | os.PathLike[str] | Image | None" = None,
    sprite: "str | os.PathLike[str] | Image | None" = None,
    beside: str | os.PathLike[str] | None = None,
    **changes: Any,
) -> "RenderedPicture":
    """Draw `program`, alone or over the photo `image`; `changes` are fields of RenderOptions.

    `program` may be a file: its text, or a PNG or SVG that was drawn here before. `sprite` is a picture for
    every object; pictures named in the program are looked up beside its file, or in the folder `beside`. The
    result has `pixels()`, `encode(kind)` and `save(path)`. Raises FileError, ParseError and UsageError, as
    p3i.paint.draw.render.render, which draws.
    """
    asked = changed(options or RenderOptions(), changes, verb="render")
    from p3i.paint.draw.render import render as draw

    if beside is None and isinstance(program, str | os.PathLike):
        beside = Path(program).parent
    given = _in_memory(program)
    if image is not None:
        image = doubted(read_image(image) if isinstance(image, str | os.PathLike) else image, given, image)
    return draw(given, asked, image=image, sprite=sprite, beside=beside)


def show(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: ShowOptions | None = None,
    *,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "RenderedPicture":
    """The overlay to look at first: `program` over `photo`, with objects, cells, names, horizon and extent.

    Without a program it is found first, by `config`. `changes` are fields of ShowOptions. The result has
    `pixels()`, `encode(kind)` and `save(path)`. Raises as `points`.
    """
    asked = changed(options or ShowOptions(), changes, verb="show")
    from p3i.paint.draw.show import show as draw

    image, found = photo_and_program(photo, program, config, progress=progress)
    return draw(image, found, asked)


def points(
    program: "Program | str | os.PathLike[str] | Image",
    options: PointsOptions | None = None,
    *,
    image: "str | os.PathLike[str] | Image | None" = None,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Listing":
    """The objects of `program` with their places, names, cells and, on the photo `image`, their presence.

    `program` may be a photo, in memory or as a file: then its program is found first, by `config`. `changes`
    are fields of PointsOptions. The result has `objects`, `columns`, `rows`, `counts`, `differs_from(size)`
    and `encode(format)`. Raises FileError, ParseError, UsageError, ProgramError for a program that draws
    nothing in front of its camera, and NoPatternError for a photo without a pattern.
    """
    asked = changed(options or PointsOptions(), changes, verb="points")
    from p3i.export.listing import Listing
    from p3i.place.objects import objects_of

    name = _file_name(image)
    given = program if isinstance(program, Program) else None
    if given is None:
        named = _file_name(program)
        either = read_either(program) if isinstance(program, str | os.PathLike) else program
        if isinstance(either, Program):
            given = either
        elif image is not None:
            raise UsageError("both are photos: name a photo and its program, or the photo alone")
        else:
            image, name = either, named
    if image is None:
        assert given is not None
        return Listing.of(objects_of(given, None, asked))
    photo, found = photo_and_program(image, given, config, progress=progress)
    return Listing.of(objects_of(found, photo, asked, image=name))


def rectify(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: RectifyOptions | None = None,
    *,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Rectified":
    """The plane of `photo` as seen straight on, by `program`, or by the one that `synth` finds by `config`.

    `changes` are fields of RectifyOptions. The result has `paint()`, `save(path)`, `back(edited)`, `record()`
    and `notes`. Raises FileError, ParseError, UsageError, ProgramError for a program without objects on the
    photo, and NoPatternError for a photo without a pattern.
    """
    asked = changed(options or RectifyOptions(), changes, verb="rectify")
    from p3i.paint.straight.rectify import rectify as straighten

    image, found = photo_and_program(photo, program, config, progress=progress)
    return straighten(image, found, asked)


def tile(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: TileOptions | None = None,
    *,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Tile":
    """A seamless texture of the pattern on `photo`, by `program` or by the one that `synth` finds.

    `changes` are fields of TileOptions. The result has `pixels`, `paint()`, `save(path)`, `record()`, `seam`
    and `notes`. Raises FileError, ParseError, UsageError, ProgramError for what is neither a lattice
    nor rings or has no object on the photo, and NoPatternError for a photo without a pattern.
    """
    asked = changed(options or TileOptions(), changes, verb="tile")
    from p3i.paint.straight.tile import tile as make

    image, found = photo_and_program(photo, program, config, progress=progress)
    return make(image, found, asked)


def inpaint(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: InpaintOptions | None = None,
    *,
    mask: "str | os.PathLike[str] | np.ndarray | None" = None,
    restore: Sequence[str | tuple[int, int]] = (),
    remove: Sequence[str | tuple[int, int]] = (),
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Inpainted":
    """`photo` with a hole filled by `program`, or by the one that `synth` finds outside of the hole.

    The hole is what `mask` marks (a picture whose white is to be filled, or bool [H, W]) and the cells of the
    objects to `restore`, by name or (i, j); objects to `remove` are taken away, ground goes on under them.
    Without any of these the hole is what is transparent. `changes` are fields of InpaintOptions. The result
    has `pixels`, `paint()`, `save(path)`, `unlike`, `holes` and `notes`. Raises FileError, ParseError,
    UsageError, ProgramError for a program without objects on the photo, and NoPatternError.
    """
    asked = changed(options or InpaintOptions(), changes, verb="inpaint")
    from p3i.paint.fill.inpaint import inpaint as fill

    image, found, hole = _hidden(photo, program, mask, config, progress)
    return fill(image, found, asked, mask=hole, restore=restore, remove=remove, progress=progress)


def find_marred(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: FindOptions | None = None,
    *,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Marred":
    """What of the pattern on `photo` differs from all other cells: a stain, a broken tile, a sign in front.

    Nothing is filled. `changes` are fields of FindOptions. The result has `mask` (bool [H, W], as `inpaint`
    takes it), `mars`, `overlay()`, `save(path)`, `record()` and `notes`. Raises FileError, ParseError,
    UsageError where too few cells are seen, ProgramError for a program without objects on the photo, and
    NoPatternError.
    """
    asked = changed(options or FindOptions(), changes, verb="find_marred")
    from p3i.paint.fill.found import find_marred as look

    image, found = photo_and_program(photo, program, config, progress=progress)
    return look(image, found, focal_mm=asked.focal_mm)


def extend(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None = None,
    options: ExtendOptions | None = None,
    *,
    mask: "str | os.PathLike[str] | np.ndarray | None" = None,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Extended":
    """`photo` continued beyond its frame by `program`, or by the one that `synth` finds.

    What `mask` marks (as of `inpaint`: a picture or bool [H, W]), and what is transparent, is filled.
    `changes` are fields of ExtendOptions, such as `by=parse_margins("10%,0,10%,0")`. The result has `pixels`,
    `margins`, `paint()`, `save(path)`, `program`, `record()` and `notes`. Raises FileError, ParseError,
    UsageError where the picture would reach the horizon, ProgramError and NoPatternError.
    """
    asked = changed(options or ExtendOptions(), changes, verb="extend")
    from p3i.paint.edit.extend import extend as continue_photo

    image, found, hidden = _hidden(photo, program, mask, config, progress)
    return continue_photo(image, found, asked, mask=hidden, progress=progress)


def edit(
    photo: "str | os.PathLike[str] | Image",
    old: Program | str | os.PathLike[str] | None,
    new: Program | str | os.PathLike[str],
    options: EditOptions | None = None,
    *,
    mask: "str | os.PathLike[str] | np.ndarray | None" = None,
    config: SearchConfig | None = None,
    progress: Progress | None = None,
    **changes: Any,
) -> "Edited":
    """`photo` with the objects of the program `old` laid anew as the program `new` says.

    Where `old` is None, it is the program that `synth` finds. What `mask` marks (as of `inpaint`: a picture
    or bool [H, W]), and what is transparent, is filled first, and both programs go on over it. `changes` are
    fields of EditOptions. The result has `pixels`, `touched`, `kept`, `removed`, `copied`, `filled`, `added`,
    `paint()`, `save(path)` and `notes`. Raises FileError, ParseError, UsageError, ProgramError for a program
    without objects, and NoPatternError.
    """
    asked = changed(options or EditOptions(), changes, verb="edit")
    from p3i.paint.edit.edit import edit as lay_anew

    wanted = _in_memory(new)
    image, found, hidden = _hidden(photo, old, mask, config, progress)
    return lay_anew(image, found, wanted, asked, mask=hidden, progress=progress)


def _hidden(
    photo: "str | os.PathLike[str] | Image",
    program: Program | str | os.PathLike[str] | None,
    mask: "str | os.PathLike[str] | np.ndarray | None",
    config: SearchConfig | None,
    progress: Progress | None,
) -> "tuple[Image, Program, np.ndarray | None]":
    """A photo, its program, searched for outside of what is hidden where it is None, and the mask of that."""
    if mask is None:
        return *photo_and_program(photo, program, config, progress=progress), None
    image = read_image(photo) if isinstance(photo, str | os.PathLike) else photo
    if isinstance(mask, str | os.PathLike):
        from p3i.vision.image import read_mask

        mask = read_mask(mask, image.size)  # once: it may come from standard input, and is needed twice
    seen = without(image, mask=mask, roi=None) if program is None else image
    _, found = photo_and_program(seen, program, config, progress=progress)
    return doubted(image, found, photo), found, mask


def _in_memory(program: Program | str | os.PathLike[str]) -> Program:
    return program if isinstance(program, Program) else read_program(program)


def _file_name(photo: object) -> str | None:
    """The last part of a photo's path; None where it has none."""
    if not isinstance(photo, str | os.PathLike) or os.fspath(photo) == "-":
        return None
    return files.as_text(Path(photo).name)
