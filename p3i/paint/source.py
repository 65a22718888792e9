"""Where a program to be drawn comes from: its own text, or a picture that was drawn of it."""

from os import PathLike, fspath
from os.path import isfile
from pathlib import Path
from xml.etree import ElementTree

from p3i.errors import FileError
from p3i.files import read_bytes
from p3i.grammar.ast import Program
from p3i.grammar.layout import source_text
from p3i.grammar.parse_error import ParseError
from p3i.grammar.parser import parse
from p3i.paint.svg import PROGRAM_TAG
from p3i.vision.write import read_png_text

PNG_KEYWORD = "p3i-program"
"""The keyword of the PNG's text entry that holds the program."""


def read_program(path: str | PathLike[str]) -> Program:
    """The program in a file: its text, or the text that `render` left in a PNG or an SVG; `-` is stdin.

    Raises FileError where the file cannot be read or is a picture without a program, ParseError where the
    text is no program, or a sketch whose holes are still open.
    """
    name = "standard input" if fspath(path) == "-" else fspath(path)
    data = read_bytes(path)
    text = program_text_in(data, name=name)
    source: str | bytes = data if text is None else text
    parsed = parse(source)
    if isinstance(parsed, Program):
        return parsed
    raise ParseError(parsed, source=source_text(source), path=name)


def is_photo(path: str | PathLike[str]) -> bool:
    """Whether a file is a picture, and none that carries a program; standard input is taken for a program.

    Files that cannot be read are no photos: their reader says why.
    """
    if fspath(path) == "-" or Path(path).suffix.lower() == ".p3p" or not isfile(path):
        return False
    try:
        data = read_bytes(path)
    except FileError:
        return False
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return _text_of_png(data) is None
    # Programs and SVG are text: no NUL, and no Netpbm's magic number.
    return b"\0" in data[:4096] or data.startswith((b"P1", b"P2", b"P3", b"P4", b"P5", b"P6"))


def program_text_in(data: bytes, *, name: str) -> str | None:
    """The text that a drawn PNG or SVG carries; None for bytes of any other kind.

    Raises FileError for a PNG or an SVG that carries none, and for other pictures.
    """
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        text = _text_of_png(data)
    elif data.lstrip().startswith((b"<?xml", b"<svg")):
        text = _text_of_svg(data, name=name)
    elif data.startswith((b"\xff\xd8\xff", b"%PDF", b"GIF8", b"RIFF")):
        raise FileError(f"{name} is a picture, and only PNG and SVG drawn by p3i carry their program")
    else:
        return None
    if text is None:
        raise FileError(f"{name} carries no program: pictures drawn by `p3i render` do")
    return text


def _text_of_png(data: bytes) -> str | None:
    try:
        return read_png_text(data).get(PNG_KEYWORD)
    except (ValueError, IndexError):  # text entries of others, broken
        return None


def _text_of_svg(data: bytes, *, name: str) -> str | None:
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise FileError(f"{name} is damaged SVG or XML: {error}") from None
    found = root.find(f".//{PROGRAM_TAG}")
    return None if found is None else found.text
