"""The one loader of programs: from their text, from a PNG or SVG that carries it, from standard input.

A file is opened once and read whole, so that pipes work wherever files do. Importing this loads no heavy
package: a program's text needs none.
"""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from xml.etree import ElementTree

from p3i.errors import FileError
from p3i.files import read_bytes, spoken
from p3i.grammar.ast import Program
from p3i.grammar.layout import most_bytes, source_text
from p3i.grammar.parse_error import ParseError
from p3i.grammar.parser import parse
from p3i.marks import PNG_KEYWORD, SVG_TAG

if TYPE_CHECKING:
    from p3i.vision.image import Image

Place = str | os.PathLike[str]
"""A file's path; `-` is standard input."""

Kind = Literal["program", "drawing", "photo", "stream"]
"""A program's text; a picture that carries one; another picture; what can be read only once."""

_PNG = b"\x89PNG\r\n\x1a\n"
_SVG = (b"<?xml", b"<svg")
_NETPBM = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"PF", b"Pf")
# Pictures whose bytes tell them, and which nobody draws programs into.
_OTHERS = (b"\xff\xd8\xff", b"%PDF", b"GIF8", b"RIFF")
_HEAD = 4096
# Of what has no end, such as a pipe, so much is read to see what it is.
_MOST_DRAWN = 2**28


def read_program(path: Place) -> Program:
    """The program in a file: its text, or the text that p3i left in a PNG or an SVG; `-` is standard input.

    Raises FileError where the file cannot be read or is a picture without a program, ParseError where the
    text is no program, or a sketch whose holes are still open.
    """
    name = spoken(path)
    data = read_bytes(path)
    return _parsed(data if (text := _carried(data, name)) is None else text, name)


def read_either(path: Place) -> "Program | Image":
    """The program in a file, or the photo that it is; a picture that carries a program is that program.

    The file is read once. Raises FileError for what cannot be read, ParseError for a text that is no program.
    """
    name = spoken(path)
    data = read_bytes(path)
    if not _is_photo(data):
        return _parsed(data if (text := _carried(data, name)) is None else text, name)
    from p3i.vision.image import image_of

    return image_of(data, name=name)


def read_source(path: Place) -> tuple[bytes, bool]:
    """The text of a program or a sketch, unread as yet, and whether it was carried by a drawing.

    Of a text no more is read than tells that it is too long for a program. Raises FileError where the file
    cannot be read or is a picture without a program.
    """
    data = read_bytes(path, most=_MOST_DRAWN, cut=True)
    text = _carried(data, spoken(path))
    return (data[: most_bytes() + 1], False) if text is None else (text.encode("utf-8"), True)


def kind_of(path: Place, *, pictures: frozenset[str] = frozenset()) -> Kind:
    """What `path` is, without reading what can be read only once: pipes and standard input are a "stream".

    A file that is not there, or cannot be read, is judged by its name: a photo where its suffix is one of
    `pictures`, else a program. Never raises.
    """
    if os.fspath(path) == "-":
        return "stream"
    place = Path(path)
    suffix = place.suffix.lower()
    if suffix == ".p3p":
        return "program"
    by_name: Kind = "photo" if suffix in pictures else "program"
    try:
        if not place.is_file():
            return "stream" if place.is_fifo() else by_name
        with open(place, "rb") as stream:
            head = stream.read(_HEAD)
            if head.startswith(_PNG):
                return "photo" if _text_of_png(head + stream.read()) is None else "drawing"
    except (OSError, ValueError):
        return by_name
    if _is_photo(head) or head.startswith(_OTHERS):
        return "photo"
    # A photo that is damaged or empty is one all the same, so that its reader says what is wrong with it.
    return by_name


def _is_photo(data: bytes) -> bool:
    """Whether bytes are a picture, and none that carries a program."""
    if data.startswith(_PNG):
        return _text_of_png(data) is None
    # Programs and SVG are text: no NUL, and no magic number of Netpbm.
    return b"\0" in data[:_HEAD] or data.startswith(_NETPBM)


def _carried(data: bytes, name: str) -> str | None:
    """The text that a drawn PNG or SVG carries; None for bytes of any other kind.

    Raises FileError for a PNG or an SVG that carries none, and for other pictures.
    """
    if data.startswith(_PNG):
        text = _text_of_png(data)
    elif data.lstrip().startswith(_SVG):
        text = _text_of_svg(data, name)
    elif data.startswith(_OTHERS):
        raise FileError(f"{name} is a picture, and only PNG and SVG drawn by p3i carry their program")
    else:
        return None
    if text is None:
        raise FileError(f"{name} carries no program: pictures drawn by `p3i render` do")
    return text


def _text_of_png(data: bytes) -> str | None:
    from p3i.vision.text import png_text

    return png_text(data).get(PNG_KEYWORD)


def _text_of_svg(data: bytes, name: str) -> str | None:
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise FileError(f"{name} is damaged SVG or XML: {error}") from None
    found = root.find(f".//{SVG_TAG}")
    return None if found is None else found.text


def _parsed(source: str | bytes, name: str) -> Program:
    parsed = parse(source)
    if isinstance(parsed, Program):
        return parsed
    raise ParseError(parsed, source=source_text(source), path=name)
