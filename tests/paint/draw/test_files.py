"""SVG and PDF as other programs read them, and the programs that pictures carry."""

import re
import zlib
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from p3i.api import render
from p3i.grammar.printer import brief
from p3i.paint.draw.svg import joined
from p3i.size import Size
from p3i.vision.image import Image
from p3i.vision.picture import Picture

SVG = "{http://www.w3.org/2000/svg}"
TEASER = """\
SetCameraPose(rx=-42, ry=-15)
for i in range(0, 4):
    for j in range(0, 4):
        if i + j >= 3:
            Draw(x=18.7*i + 9.7*j - 57, y=19.7*j - 31)
"""


@pytest.fixture
def teaser(tmp_path: Path) -> Path:
    path = tmp_path / "teaser.p3p"
    path.write_text(TEASER)
    return path


def test_the_svg_of_the_papers_first_figure_is_the_golden_one(
    teaser: Path, golden: Callable[[Path, str], None]
) -> None:
    drawn = render(teaser, size=Size(320, 240)).encode("svg").decode()
    golden(Path(__file__).parent / "golden" / "teaser.svg", drawn)


def test_an_svg_is_well_formed_and_places_dots_where_the_objects_are(teaser: Path) -> None:
    picture = render(teaser, size=Size(320, 240), horizon=True)
    root = ElementTree.fromstring(picture.encode("svg"))
    assert root.get("viewBox") == "-0.5 -0.5 320 240"
    ellipses = root.findall(f".//{SVG}ellipse")
    places = [re.match(r"translate\((\S+) (\S+)\)", ellipse.get("transform", "")) for ellipse in ellipses]
    found = np.array([[float(part) for part in place.groups()] for place in places if place])
    assert len(found) == 10
    # The centre of an ellipse is a little off the projected centre of its circle.
    apart = np.linalg.norm(found[:, None] - picture.centers_px, axis=2).min(axis=1)
    assert apart.max() < 1.5


def test_a_photo_in_an_svg_is_the_photo(teaser: Path) -> None:
    grey = Image(np.full((24, 32, 3), 0.5, np.float32), np.ones((24, 32), bool))
    root = ElementTree.fromstring(render(teaser, image=grey).encode("svg"))
    (image,) = root.findall(f"{SVG}image")
    assert image.get("href", "").startswith("data:image/jpeg;base64,")
    grey.valid[0] = False
    root = ElementTree.fromstring(render(teaser, image=grey).encode("svg"))
    (image,) = root.findall(f"{SVG}image")
    assert image.get("href", "").startswith("data:image/png;base64,")
    assert root.find(f"{SVG}rect") is None, "transparent paper"


def test_a_pdf_has_a_table_that_finds_its_objects_and_streams_of_the_length_they_say(teaser: Path) -> None:
    half = Image(np.full((24, 32, 3), 0.5, np.float32), np.arange(24 * 32).reshape(24, 32) % 2 == 0)
    for picture in (render(teaser, horizon=True), render(teaser, image=half, cells=True)):
        data = picture.encode("pdf")
        assert data.startswith(b"%PDF-1.4") and data.endswith(b"%%EOF\n")
        table = int(re.findall(rb"startxref\n(\d+)", data)[-1])
        places = [int(place) for place in re.findall(rb"(\d{10}) 00000 n", data[table:])]
        for number_of, place in enumerate(places, start=1):
            assert data[place:].startswith(b"%d 0 obj\n" % number_of)
        for found in re.finditer(rb"/Length (\d+) >>\nstream\n", data):
            end = found.end() + int(found[1])
            assert data[end:].startswith(b"\nendstream")
        begin = data.index(b"stream\n", places[3]) + 7
        content = zlib.decompress(data[begin : data.index(b"\nendstream", begin)]).decode()
        assert content.count(" b Q") == 10, "a filled and stroked ellipse an object"
        assert content.count("q ") == content.count(" Q")


def test_a_pdf_page_is_the_canvas_at_96_pixels_an_inch(teaser: Path) -> None:
    data = render(teaser, size=Size(400, 300)).encode("pdf")
    assert b"/MediaBox [0 0 300 225]" in data
    assert b"/MediaBox [0 0 14400 1440]" in render(teaser, size=Size(40_000, 4_000), max_px=10**9).encode(
        "pdf"
    )


def test_segments_that_follow_each_other_become_one_line() -> None:
    path = np.array([[[0, 0], [1, 0]], [[1, 0], [1, 1.5]], [[5, 5], [6, 6]]])
    assert joined(path) == [[("0", "0"), ("1", "0"), ("1", "1.5")], [("5", "5"), ("6", "6")]]
    assert [brief(value) for value in (-0.001, 1.0, 2.504, -3.25)] == ["0", "1", "2.5", "-3.25"]


def test_a_deep_tiff_says_what_it_loses_without_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    deep = Picture(np.zeros((2, 3, 3), np.uint16), icc=b"profile")
    assert deep.notes("tiff") == ()
    monkeypatch.setattr("p3i.vision.picture.has_tifffile", lambda: False)
    (note,) = deep.notes("tiff")
    assert "p3i[tiff]" in note
    assert Picture(np.zeros((2, 3, 3), np.uint16)).notes("tiff") == deep.notes("png") == ()
