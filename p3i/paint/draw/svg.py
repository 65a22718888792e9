"""A scene as SVG. Pixel centres lie at whole numbers here too: the view box begins at (-0.5, -0.5)."""

import base64
from xml.sax.saxutils import escape

import numpy as np

from p3i.grammar.printer import brief
from p3i.marks import program_element
from p3i.paint.draw.scene import TO_BASELINE, Colour, Dots, Labels, Pixels, Scene, Strokes
from p3i.vision.write import encode


def svg(scene: Scene, *, program_text: str) -> str:
    """The SVG document, with the text of its program in the metadata."""
    width, height = scene.size.width, scene.size.height
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="-0.5 -0.5 {width} {height}">',
        program_element(program_text),
    ]
    if scene.paper is not None:
        lines.append(
            f'<rect x="-0.5" y="-0.5" width="{width}" height="{height}" fill="{_hex(scene.paper)}"/>'
        )
    for layer in scene.layers:
        match layer:
            case Pixels(values=values):
                lines.append(
                    f'<image x="-0.5" y="-0.5" width="{width}" height="{height}" '
                    f'href="data:{_data_of(values)}"/>'
                )
            case Strokes():
                lines.append(_strokes(layer))
            case Dots():
                lines += _dots(layer)
            case Labels():
                lines += _labels(layer)
    return "\n".join([*lines, "</svg>", ""])


def joined(segments: np.ndarray) -> list[list[tuple[str, str]]]:
    """Segments [S, 2, 2] as polylines of printed coordinates, joined where one ends as the next begins."""
    lines: list[list[tuple[str, str]]] = []
    for (x0, y0), (x1, y1) in segments.tolist():
        start, end = (brief(x0), brief(y0)), (brief(x1), brief(y1))
        if lines and lines[-1][-1] == start:
            lines[-1].append(end)
        else:
            lines.append([start, end])
    return lines


def _strokes(strokes: Strokes) -> str:
    path = "".join("M" + "L".join(" ".join(point) for point in line) for line in joined(strokes.segments))
    opacity = f' stroke-opacity="{brief(strokes.opacity)}"' if strokes.opacity < 1 else ""
    return (
        f'<path d="{path}" fill="none" stroke="{_hex(strokes.colour)}" stroke-width="{brief(strokes.width)}"'
        f'{opacity} stroke-linecap="round" stroke-linejoin="round"/>'
    )


def _dots(dots: Dots) -> list[str]:
    lines = [f'<g stroke-width="{brief(dots.rim_width)}">']
    for (x, y), (a, b), angle, colour, rim in zip(
        dots.centers.tolist(),
        dots.axes.tolist(),
        dots.angles_deg.tolist(),
        dots.colours,
        dots.rims,
        strict=True,
    ):
        lines.append(
            f'<ellipse rx="{brief(a)}" ry="{brief(b)}" fill="{_hex(colour)}" stroke="{_hex(rim)}" '
            f'transform="translate({brief(x)} {brief(y)}) rotate({brief(angle)})"/>'
        )
    return [*lines, "</g>"]


def _labels(labels: Labels) -> list[str]:
    lines = [
        f'<g font-family="sans-serif" text-anchor="middle" fill="{_hex(labels.colour)}" '
        f'stroke="{_hex(labels.rim)}" stroke-linejoin="round" paint-order="stroke">'
    ]
    for text, (x, y), size, rim in labels.words():
        lines.append(
            f'<text x="{brief(x)}" y="{brief(y + TO_BASELINE * size)}" font-size="{brief(size)}" '
            f'stroke-width="{brief(2 * rim)}">{escape(text)}</text>'
        )
    return [*lines, "</g>"]


def _data_of(values: np.ndarray) -> str:
    # JPEG for photos: a lossless copy of one would be several times as large as the photo's own file.
    if values.shape[2] == 3:
        return "image/jpeg;base64," + base64.b64encode(encode(values, kind=".jpg")).decode("ascii")
    alpha = values[:, :, 3].astype(np.float32) / 255
    data = encode(np.ascontiguousarray(values[:, :, :3]), kind=".png", alpha=alpha)
    return "image/png;base64," + base64.b64encode(data).decode("ascii")


def _hex(colour: Colour | np.ndarray) -> str:
    return "#" + "".join(f"{int(part):02x}" for part in colour)
