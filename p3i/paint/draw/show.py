"""The overlay that people look at first: the photo with its objects, cells, names, horizon and extent.

Convention: pixels of the canvas, pixel centres at whole numbers.
"""

import dataclasses
from typing import Any

import numpy as np

from p3i.grammar.ast import Program
from p3i.interp.unroll import nest
from p3i.options.render import RenderOptions
from p3i.options.show import ShowOptions
from p3i.paint.draw import scene
from p3i.paint.draw.bent import bent
from p3i.paint.draw.render import RenderedPicture, render
from p3i.paint.draw.view import View, camera_view
from p3i.place import outlines
from p3i.place.objects import Object, Objects, objects_of
from p3i.place.presence import THERE
from p3i.records import changed
from p3i.size import Size
from p3i.vision.image import Image, resized

_DOT_SHARE = 0.1
"""A dot's radius as a share of the spacing."""
_TEXT_SHARE = 0.3
"""The size of letters as a share of their cell's height on the picture."""
_SMALLEST, _LARGEST = 1 / 80, 1 / 24
"""The size of letters as shares of the picture's longer side."""
_LEAST_PX = 9.0
_LETTER = 0.6
"""The width of a letter as a share of its size."""
_CLEAR = 0.4
"""Around each label this share of its size stays free on every side, or labels would carpet the photo."""
_STRIDES = (10, 5, 2, 1)
"""Where not all labels have room, every tenth row and column goes first, then every fifth, every second."""

_EXTENT: scene.Colour = (255, 196, 0)
_ABSENT: scene.Colour = (214, 40, 57)
_DARK: scene.Colour = (25, 28, 38)


def show(
    photo: Image, program: Program, options: ShowOptions | None = None, **changes: Any
) -> RenderedPicture:
    """`program` drawn over `photo` with all that tells whether it is right; its `notes` count the objects.

    `changes` are fields of ShowOptions. Raises UsageError for options that cannot be, ProgramError for a
    program that draws nothing in front of its camera.
    """
    options = changed(options or ShowOptions(), changes, verb="show")
    photo = resized(photo, options.longer)
    focal_mm = _focal(photo, program, options)
    judged = photo if options.presence else None
    found = objects_of(program, judged, size=photo.size, focal_mm=focal_mm)
    below = RenderOptions(
        markers=False,
        cells=options.cells,
        horizon=options.horizon,
        focal_mm=options.focal_mm,
    )
    picture = render(program, below, image=photo, named_pictures=False)
    view = camera_view(picture.camera, picture.size)
    layers = _layers(found, view, options)
    k1 = program.header.lens_k1 if program.header else None
    if k1:
        layers = [bent(layer, view.size, k1) for layer in layers]
    drawn = dataclasses.replace(picture.scene, layers=(*picture.scene.layers, *layers))
    return dataclasses.replace(picture, scene=drawn, notes=(*picture.notes, found.counts))


def _focal(photo: Image, program: Program, options: ShowOptions) -> float | None:
    if options.focal_mm is not None or (program.header and program.header.focal_mm is not None):
        return options.focal_mm
    return photo.focal_mm


def _layers(found: Objects, view: View, options: ShowOptions) -> list[scene.Layer]:
    chart = outlines.chart_of(found.placed.pattern)
    layers: list[scene.Layer] = []
    if options.extent:
        layers += _extent(found, view)
    if options.points:
        layers += _marks(found, view, chart)
    if options.labels != "none":
        layers.append(_labels(found, view, names=options.labels == "names", dots=options.points))
    return layers


def _marks(found: Objects, view: View, chart: outlines.Chart) -> list[scene.Layer]:
    """Dots on objects that are there, small grey ones where nobody can tell, crosses where one is missed."""
    there = [each for each in found.objects if each.presence is not None and each.presence >= THERE]
    unsure = [each for each in found.objects if each.presence is None]
    if not found.judged:
        there, unsure = unsure, []
    absent = [each for each in found.objects if each.presence is not None and each.presence < THERE]
    parts = nest(found.program)
    loops = (parts.for_i is not None) + (parts.for_j is not None)
    radius = _DOT_SHARE * outlines.pitch(chart)
    index = np.array([(each.i, each.j) for each in there], np.int64).reshape(-1, 2)
    layers: list[scene.Layer] = [
        scene.dots(
            view, _points(there), radius=radius, colours=scene.colours_of(index, loops=loops), light_rim=True
        )
    ]
    if unsure:
        grey = np.full((len(unsure), 3), 128, np.uint8)
        layers.append(scene.dots(view, _points(unsure), radius=radius / 2, colours=grey, light_rim=True))
    if absent:
        arms = radius * np.array([[(-1, -1), (1, 1)], [(-1, 1), (1, -1)]])
        crosses = (_points(absent)[:, None, None] + arms).reshape(-1, 2, 2)
        lines = view.project_segments(crosses)
        width = max(1.0, view.size.longer / 500)
        layers += [scene.Strokes(lines, scene.WHITE, 2.6 * width), scene.Strokes(lines, _ABSENT, 1.3 * width)]
    return layers


def _extent(found: Objects, view: View) -> list[scene.Layer]:
    """The outline of all cells together: the sides that one cell alone has."""
    sides: dict[tuple[tuple[float, float], ...], list[tuple[tuple[float, float], ...]]] = {}
    for each in found.objects:
        for start, end in zip(each.cell, (*each.cell[1:], *each.cell[:1]), strict=True):
            corners = sorted((round(x, 4) + 0.0, round(y, 4) + 0.0) for x, y in (start, end))
            sides.setdefault(tuple(corners), []).append((start, end))
    alone = np.array([pieces[0] for pieces in sides.values() if len(pieces) == 1]).reshape(-1, 2, 2)
    lines = view.project_segments(alone)
    width = max(1.0, view.size.longer / 450)
    return [scene.Strokes(lines, _DARK, 2.4 * width, 0.6), scene.Strokes(lines, _EXTENT, 1.3 * width)]


def _labels(found: Objects, view: View, *, names: bool, dots: bool) -> scene.Labels:
    """Names or indices above the dots (in their place without dots), as many as have room."""
    texts = [each.name if names else f"{each.i},{each.j}" for each in found.objects]
    if not texts:
        return scene.Labels((), np.zeros((0, 2)), np.zeros(0))
    anchors, _ = view.project(_points(found.objects))
    cell_heights = np.array([_height(view, each) for each in found.objects])
    longer = view.size.longer
    sizes = np.clip(cell_heights * _TEXT_SHARE, max(_LEAST_PX, longer * _SMALLEST), longer * _LARGEST)
    if dots:
        # Clear of the dot, which is about a tenth of the cell.
        anchors = anchors - np.stack([np.zeros(len(sizes)), 0.55 * sizes + 0.16 * cell_heights], axis=1)
    widths = _LETTER * sizes * np.array([len(text) for text in texts])
    halves = np.stack([widths, sizes], axis=1) / 2 + sizes[:, None] * _CLEAR
    kept = _with_room(anchors, halves, _priority(found.objects), view.size)
    return scene.Labels(tuple(texts[place] for place in kept), anchors[kept], sizes[kept])


def _priority(objects: tuple[Object, ...]) -> np.ndarray:
    """The order [M] in which objects ask for room for their label."""
    levels = [
        next(k for k, stride in enumerate(_STRIDES) if not (each.row % stride or each.column % stride))
        for each in objects
    ]
    return np.argsort(np.array(levels), kind="stable")


def _with_room(anchors: np.ndarray, halves: np.ndarray, order: np.ndarray, size: Size) -> np.ndarray:
    """The labels [K], in order, that overlap none before them and lie on the picture."""
    limits = np.array([size.width, size.height]) - 0.5
    room = np.minimum(anchors - halves + 0.5, limits - anchors - halves)
    inside = np.asarray(room.min(axis=1) >= 0)
    kept = np.zeros(len(anchors), bool)
    # Labels are found again by the squares that they touch, each as large as the largest label.
    side = max(1.0, 2 * float(halves.max()))
    squares: dict[tuple[int, int], list[int]] = {}
    for place in order.tolist():
        if not inside[place]:
            continue
        column, row = (int(part // side) for part in anchors[place])
        near = [
            other
            for across in (column - 1, column, column + 1)
            for down in (row - 1, row, row + 1)
            for other in squares.get((across, down), ())
        ]
        gaps: np.ndarray = np.abs(anchors[near] - anchors[place]) - halves[near] - halves[place]
        if (gaps.max(axis=1, initial=-np.inf) >= 0).all():
            kept[place] = True
            squares.setdefault((column, row), []).append(place)
    return np.flatnonzero(kept)


def _height(view: View, each: Object) -> float:
    pixels, _ = view.project(np.array(each.cell))
    known = pixels[np.isfinite(pixels).all(axis=1)]
    return float(np.ptp(known[:, 1])) if len(known) else 0.0


def _points(objects: tuple[Object, ...] | list[Object]) -> np.ndarray:
    return np.array([(each.x, each.y) for each in objects], float).reshape(-1, 2)
