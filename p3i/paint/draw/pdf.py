"""A scene as a PDF page of vectors, written by hand: a page, its content, and a picture for each pixel layer.

A pixel is 1/96 inch. Nothing in the file depends on the time or the place, so equal scenes give equal files.
"""

import math
import zlib

import numpy as np

from p3i.grammar.printer import brief
from p3i.paint.draw.scene import TO_BASELINE, Colour, Dots, Labels, Pixels, Scene, Strokes
from p3i.paint.draw.svg import joined
from p3i.vision.write import encode

_POINTS_PER_PX = 0.75
_MOST_POINTS = 14_400
"""Pages of viewers end at 200 inches."""

_HELVETICA = 0.59
"""The mean width of capitals and digits, as a share of their size."""

_BEZIER = 4 / 3 * (math.sqrt(2) - 1)
"""Where the control points of a quarter circle lie."""


def pdf(scene: Scene) -> bytes:
    """The PDF file of a scene; paper that is transparent comes out white."""
    width, height = scene.size.width, scene.size.height
    scale = min(_POINTS_PER_PX, _MOST_POINTS / scene.size.longer)
    objects: list[bytes] = [b"", b"", b"", b""]  # catalog, pages, page, content: filled in below
    pictures: list[int] = []
    opacities: list[float] = []
    # From pixels (y down, centres at whole numbers) to points (y up).
    parts = [f"{scale:.6f} 0 0 {-scale:.6f} {0.5 * scale:.6f} {(height - 0.5) * scale:.6f} cm 1 J 1 j"]
    if scene.paper is not None:
        parts.append(f"{_rgb(scene.paper)} rg -0.5 -0.5 {width} {height} re f")
    for layer in scene.layers:
        match layer:
            case Pixels(values=values):
                parts.append(f"q {width} 0 0 {-height} -0.5 {height - 0.5} cm /P{len(pictures)} Do Q")
                pictures.append(_add_picture(objects, values))
            case Strokes():
                parts.append(_strokes(layer, opacities))
            case Dots():
                parts += _dots(layer)
            case Labels():
                parts += _labels(layer)
    states = " ".join(f"/O{k} << /CA {brief(value)} >>" for k, value in enumerate(opacities))
    named = " ".join(f"/P{k} {place} 0 R" for k, place in enumerate(pictures))
    with_text = any(isinstance(layer, Labels) for layer in scene.layers)
    font = "/Font << /F << /Type /Font /Subtype /Type1 /BaseFont /Helvetica >> >> " if with_text else ""
    objects[0] = b"<< /Type /Catalog /Pages 2 0 R >>"
    objects[1] = b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>"
    objects[2] = (
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {brief(width * scale)} {brief(height * scale)}] "
        f"/Contents 4 0 R /Resources << {font}/ExtGState << {states} >> /XObject << {named} >> >> >>"
    ).encode("ascii")
    objects[3] = _stream("/Filter /FlateDecode", zlib.compress("\n".join(parts).encode("ascii")))
    return _file(objects)


def _strokes(strokes: Strokes, opacities: list[float]) -> str:
    if strokes.opacity not in opacities:
        opacities.append(strokes.opacity)
    path = " ".join(
        " ".join(f"{x} {y} {'l' if k else 'm'}" for k, (x, y) in enumerate(line))
        for line in joined(strokes.segments)
    )
    state = opacities.index(strokes.opacity)
    return f"q /O{state} gs {_rgb(strokes.colour)} RG {brief(strokes.width)} w {path} S Q"


def _dots(dots: Dots) -> list[str]:
    lines = [f"{brief(dots.rim_width)} w"]
    angles = np.radians(dots.angles_deg).tolist()
    for (x, y), (a, b), angle, colour, rim in zip(
        dots.centers.tolist(), dots.axes.tolist(), angles, dots.colours, dots.rims, strict=True
    ):
        cos, sin = math.cos(angle), math.sin(angle)
        turn = f"{cos:.5f} {sin:.5f} {-sin:.5f} {cos:.5f} {brief(x)} {brief(y)} cm"
        lines.append(f"q {_rgb(colour)} rg {_rgb(rim)} RG {turn} {_ellipse(a, b)} b Q")
    return lines


def _labels(labels: Labels) -> list[str]:
    lines = [f"{_rgb(labels.colour)} rg {_rgb(labels.rim)} RG"]
    for text, (x, y), size, rim in labels.words():
        word = text.encode("latin-1", "replace").decode("latin-1")
        word = "".join(
            f"\\{ord(mark):03o}" if mark in "()\\" or not " " <= mark <= "~" else mark for mark in word
        )
        left = x - _HELVETICA * size * len(text) / 2
        at = f"1 0 0 -1 {brief(left)} {brief(y + TO_BASELINE * size)} Tm ({word}) Tj"
        # First the rim, then the letters over it.
        lines += [f"{brief(2 * rim)} w BT /F {brief(size)} Tf {mode} Tr {at} ET" for mode in (1, 0)]
    return lines


def _ellipse(a: float, b: float) -> str:
    curve = f"{brief(a)} 0 m"
    for turn in range(4):
        cos, sin = (1, 0, -1, 0)[turn], (0, 1, 0, -1)[turn]
        quarter = ((1, _BEZIER), (_BEZIER, 1), (0, 1))
        points = ((a * (cos * u - sin * v), b * (sin * u + cos * v)) for u, v in quarter)
        curve += "".join(f" {brief(x)} {brief(y)}" for x, y in points) + " c"
    return curve


def _add_picture(objects: list[bytes], values: np.ndarray) -> int:
    """Append a picture to the objects (and its transparency, if it has one) and return its number."""
    height, width = values.shape[:2]
    kind = f"/Type /XObject /Subtype /Image /Width {width} /Height {height} /BitsPerComponent 8"
    if values.shape[2] == 3:
        coded = encode(values, kind=".jpg")  # as in the SVG
        objects.append(_stream(f"{kind} /ColorSpace /DeviceRGB /Filter /DCTDecode", coded))
        return len(objects)
    alpha = zlib.compress(np.ascontiguousarray(values[:, :, 3]).tobytes())
    objects.append(_stream(f"{kind} /ColorSpace /DeviceGray /Filter /FlateDecode", alpha))
    colour = zlib.compress(np.ascontiguousarray(values[:, :, :3]).tobytes())
    mask = f"/SMask {len(objects)} 0 R"
    objects.append(_stream(f"{kind} /ColorSpace /DeviceRGB /Filter /FlateDecode {mask}", colour))
    return len(objects)


def _stream(entries: str, data: bytes) -> bytes:
    head = f"<< {entries} /Length {len(data)} >>\nstream\n".encode("ascii")
    return head + data + b"\nendstream"


def _file(objects: list[bytes]) -> bytes:
    body = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n"
    places = []
    for number_of, content in enumerate(objects, start=1):
        places.append(len(body))
        body += b"%d 0 obj\n" % number_of + content + b"\nendobj\n"
    table = b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    table += b"".join(b"%010d 00000 n \n" % place for place in places)
    trailer = b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, len(body))
    return body + table + trailer


def _rgb(colour: Colour | np.ndarray) -> str:
    return " ".join(f"{int(part) / 255:.3f}" for part in colour)
