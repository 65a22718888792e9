"""Each format, read back by a library that others read it with, and held to a golden file."""

import contextlib
import csv
import io
import json
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import p3i
from p3i.carried import read_program
from p3i.errors import UsageError
from p3i.options.cell import CellSize, parse_cell
from p3i.options.points import FORMATS
from p3i.place.clip import area
from p3i.place.objects import Objects

GOLDEN = Path(__file__).parent / "golden"
HEAD = "# /// p3p\n# version = 1\n# canvas = [640, 480]\n# ///\n"
BOARD = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 12):
    for j in range(0, 8):
        Draw(x=5*i - 27.5, y=5*j - 17.5)
"""
RINGS = """SetCameraPose(rx=-20, ry=10)
for i in range(1, 3):
    for j in range(0, 4):
        Draw(x=8*i*Cos(90*j) + 2, y=8*i*Sin(90*j))
"""
SMALL = """SetCameraPose(rx=-30, ry=8)
for i in range(0, 3):
    for j in range(0, 2):
        Draw(x=30*i - 50, y=20*j - 10)
"""


def board(**changes) -> Objects:
    return p3i.points(p3i.loads(HEAD + BOARD), **changes)


# DXF's frame belongs to ezdxf and its version: it is read back instead.
@pytest.mark.parametrize("form", [form for form in FORMATS if form != "dxf"])
def test_a_small_list_is_written_as_reviewed(form: str, golden: Callable[[Path, str], None]) -> None:
    for name, text in (("small", SMALL), ("rings", RINGS)):
        ending = {"coco": "coco.json", "labelme": "labelme.json", "yolo": "txt"}.get(form, form)
        golden(GOLDEN / f"{name}.{ending}", p3i.points(p3i.loads(HEAD + text)).encode(form).decode())


@pytest.mark.parametrize("form", FORMATS)
def test_the_same_objects_give_the_same_bytes(form: str) -> None:
    assert board().encode(form) == board().encode(form)


@pytest.mark.parametrize("form", FORMATS)
def test_an_empty_list_is_a_file_too(form: str) -> None:
    text = HEAD + SMALL.replace("20*j - 10", "20*j + 900").replace("rx=-30", "rx=0")
    found = p3i.points(p3i.loads(text))
    assert found.objects == () and found.outside == 6
    # A YOLO file says nothing but objects: that of a picture without any is empty.
    assert bool(found.encode(form)) == (form != "yolo")


def test_csv_has_a_line_for_each_well() -> None:
    rows = list(csv.DictReader(io.StringIO(board().encode("csv").decode())))
    assert [row["name"] for row in rows] == [f"{a}{k}" for a in "ABCDEFGH" for k in range(1, 13)]
    assert rows[13] | {"row": "2", "column": "2", "i": "1", "j": "1", "presence": ""} == rows[13]
    assert rows[0]["cell_px"].startswith("POLYGON ((")


def test_all_formats_keep_every_digit_of_places_on_a_large_photo() -> None:
    """On 40,000 pixels a place to a thousandth has eight digits, and none is lost on the way into a file."""
    text = HEAD.replace("[640, 480]", "[40000, 30000]") + BOARD
    found = p3i.points(p3i.loads(text))
    last = found.objects[-1]
    places = {number for corner in last.cell_px for number in corner} | {last.x_px, last.y_px}
    assert max(places) > 10_000 and any(round(place, 1) != place for place in places)
    row = list(csv.DictReader(io.StringIO(found.encode("csv").decode())))[-1]
    corners = [tuple(map(float, pair.split())) for pair in row["cell_px"][10:-2].split(", ")]
    assert corners == [*last.cell_px, last.cell_px[0]]
    assert (float(row["x_px"]), float(row["y_px"]), float(row["x"])) == (last.x_px, last.y_px, last.x)
    record = json.loads(found.encode("json"))["objects"][-1]
    assert [tuple(corner) for corner in record["cell_px"]] == list(last.cell_px)
    for form, moved in (("labelme", places), ("geojson", places), ("coco", places - {last.x_px, last.y_px})):
        numbers = set(numbers_in(json.loads(found.encode(form))))
        assert {round(place + 0.5, 3) for place in moved} <= numbers, form
    drawing = found.encode("svg").decode()
    assert all(number.rstrip("0").rstrip(".") in drawing for number in (f"{place:.3f}" for place in places))


def numbers_in(value: object) -> Iterator[float]:
    """All numbers of a JSON value."""
    if isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from numbers_in(part)
    elif isinstance(value, int | float):
        yield float(value)


def test_json_holds_the_program_that_drew_it() -> None:
    record = json.loads(board().encode("json"))
    assert p3i.loads(record["program"]) == p3i.loads(HEAD + BOARD)
    assert (record["width"], record["height"], record["columns"], record["rows"]) == (640, 480, 12, 8)
    first = record["objects"][0]
    x, y = np.array(first["cell_px"]).T
    assert x.min() < first["center_px"][0] < x.max() and y.min() < first["center_px"][1] < y.max()


# pycocotools 2.0.11 knows the older way of numpy to make arrays.
@pytest.mark.filterwarnings("ignore:__array__ implementation doesn:DeprecationWarning")
def test_coco_passes_the_loader_of_coco_itself(tmp_path: Path) -> None:
    from pycocotools.coco import COCO

    path = tmp_path / "board.json"
    board().save(path, form="coco")
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO(str(path))
    annotations = coco.loadAnns(coco.getAnnIds(imgIds=[1]))
    assert len(annotations) == 96
    assert annotations[0]["attributes"]["name"] == "A1"
    for annotation in (annotations[0], annotations[50]):
        mask = coco.annToMask(annotation)
        assert mask.shape == (480, 640)
        # COCO's own area of the pixels inside; a border pixel may fall on either side.
        assert abs(int(mask.sum()) - annotation["area"]) < 0.08 * annotation["area"]
        rows, columns = np.nonzero(mask)
        x, y, width, height = annotation["bbox"]
        assert (
            abs(columns.mean() + 0.5 - (x + width / 2)) < 2 and abs(rows.mean() + 0.5 - (y + height / 2)) < 2
        )
        assert mask[round(annotation["keypoints"][1]), round(annotation["keypoints"][0])]


def test_coco_cuts_cells_off_at_the_edge_of_the_photo() -> None:
    found = p3i.points(p3i.loads(HEAD + BOARD), outside=True)
    record = json.loads(found.encode("coco"))
    for annotation in record["annotations"]:
        x, y, width, height = annotation["bbox"]
        assert x >= 0 and y >= 0 and x + width <= 640 + 1e-6 and y + height <= 480 + 1e-6
        assert annotation["area"] > 0


def test_yolo_has_the_box_of_each_cell_as_shares_of_the_photo() -> None:
    found = p3i.points(p3i.loads(HEAD.replace("640, 480", "600, 480") + BOARD))
    lines = found.encode("yolo").decode().splitlines()
    assert len(lines) == len(found.objects) > 80
    for line, each in zip(lines, found.objects, strict=True):
        label, *shares = line.split(" ")
        assert label == "0"
        x, y, width, height = np.array(shares, float) * (600, 480, 600, 480)
        # Edges at whole numbers; what sticks out of the photo is cut off.
        corners = (np.array(each.cell_px) + 0.5).clip(0, (600, 480))
        low, high = corners.min(axis=0), corners.max(axis=0)
        if (corners > 0).all() and (corners < (600, 480)).all():
            assert [x - width / 2, y - height / 2] == pytest.approx(low, abs=2e-3)
            assert [x + width / 2, y + height / 2] == pytest.approx(high, abs=2e-3)
        assert x - width / 2 >= -1e-6 and x + width / 2 <= 600 + 1e-6 and width > 0 and height > 0


def test_yolo_cuts_cells_off_and_leaves_out_those_beyond_the_photo() -> None:
    program = SMALL.replace("rx=-30, ry=8", "rx=0, ry=0").replace("30*i", "70*i")
    found = p3i.points(p3i.loads(HEAD.replace("640, 480", "100, 100") + program), outside=True)
    boxes = [list(map(float, line.split()[1:])) for line in found.encode("yolo").decode().splitlines()]
    assert 0 < len(boxes) < len(found.objects) == 6
    sides = [(x - w / 2, x + w / 2, y - h / 2, y + h / 2) for x, y, w, h in boxes]
    assert all(min(each) >= -1e-8 and max(each) <= 1 + 1e-8 for each in sides)
    assert any(left == pytest.approx(0, abs=1e-8) for left, *_ in sides)


def test_labelme_has_a_polygon_and_a_point_for_each_object() -> None:
    record = json.loads(board(label="well").encode("labelme"))
    assert record["imageWidth"] == 640 and record["imageData"] is None
    kinds = [shape["shape_type"] for shape in record["shapes"]]
    assert kinds.count("polygon") == kinds.count("point") == 96
    assert {shape["label"] for shape in record["shapes"]} == {"well"}
    assert all(len(shape["points"]) >= 3 for shape in record["shapes"] if shape["shape_type"] == "polygon")


def test_pixels_of_others_lie_half_a_pixel_on() -> None:
    found = board()
    (x, y), first = found.objects[0].cell_px[0], found.objects[0]
    labelme, coco = (json.loads(found.encode(form)) for form in ("labelme", "coco"))
    assert labelme["shapes"][0]["points"][0] == pytest.approx([x + 0.5, y + 0.5])
    assert coco["annotations"][0]["segmentation"][0][:2] == pytest.approx([x + 0.5, y + 0.5])
    assert coco["annotations"][0]["keypoints"][:2] == pytest.approx([first.x_px, first.y_px])


def test_rings_of_geojson_are_closed_and_counterclockwise() -> None:
    features = json.loads(board().encode("geojson"))["features"]
    assert len(features) == 96
    for feature in features:
        (ring,) = feature["geometry"]["coordinates"]
        assert ring[0] == ring[-1] and len(ring) >= 4
        turn = sum(a[0] * b[1] - a[1] * b[0] for a, b in pairwise(ring))
        assert turn > 0


def test_svg_is_read_back_with_all_cells_middles_and_names(tmp_path: Path) -> None:
    import svgelements

    path = tmp_path / "board.svg"
    found = board()
    found.save(path)
    drawing = svgelements.SVG.parse(str(path), reify=False)
    elements = list(drawing.elements())
    cells = [each for each in elements if isinstance(each, svgelements.Polygon)]
    words = [each.text for each in elements if isinstance(each, svgelements.Text)]
    assert len(cells) == 96 and sum(isinstance(each, svgelements.Circle) for each in elements) == 96
    assert words == [each.name for each in found.objects]
    corners = np.array([(point.x, point.y) for point in cells[0].points])[:4]
    assert area(corners) == pytest.approx(area(np.array(found.objects[0].cell_px)), rel=0.01)
    assert read_program(path) == p3i.loads(HEAD + BOARD)


def test_dxf_is_read_back_with_layers_on_the_plane(tmp_path: Path) -> None:
    import ezdxf

    path = tmp_path / "board.dxf"
    found = board()
    found.save(path)
    drawing = ezdxf.readfile(path)  # pyright: ignore[reportPrivateImportUsage]
    assert drawing.audit().errors == []
    space = drawing.modelspace()
    cells, points, names = (list(space.query(kind)) for kind in ("LWPOLYLINE", "POINT", "TEXT"))
    assert len(cells) == len(points) == len(names) == 96
    assert [name.dxf.text for name in names] == [each.name for each in found.objects]
    # y points up there.
    assert tuple(points[0].dxf.location)[:2] == pytest.approx((-27.5, 17.5))
    outline = np.array([corner[:2] for corner in cells[0].get_points()])
    assert area(outline) == pytest.approx(25)


def test_dxf_without_its_extra_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "ezdxf", None)
    with pytest.raises(UsageError, match=r"p3i\[cad\]"):
        board().encode("dxf")


def test_an_unknown_format_is_refused_by_name() -> None:
    with pytest.raises(UsageError, match="not 'xls'"):
        board().encode("xls")


METRIC = """SetCameraPose(rx=-35, ry=12)
for i in range(-1, 3):
    for j in range(0, 3):
        Draw(x=11*i - 1.5*j - 8, y=2*i + 9*j - 12)
"""


def test_a_cell_of_true_size_makes_lengths_of_places() -> None:
    found = p3i.points(p3i.loads(HEAD + METRIC), cell=parse_cell("600x400mm"))
    for each in found.objects:
        assert each.true == pytest.approx((600 * each.i, 400 * each.j), abs=0.01)
        corners = np.array(each.cell_true) - each.true
        assert sorted(map(tuple, np.round(corners).tolist())) == [
            (-300, -200),
            (-300, 200),
            (300, -200),
            (300, 200),
        ]
    record = json.loads(found.encode("json"))
    assert (record["unit"], record["cell_size"]) == ("mm", [600, 400])
    assert [tuple(each["center_true"]) for each in record["objects"]] == [each.true for each in found.objects]
    rows = list(csv.DictReader(io.StringIO(found.encode("csv").decode())))
    assert [(float(row["x_mm"]), float(row["y_mm"])) for row in rows] == [each.true for each in found.objects]
    plain = p3i.points(p3i.loads(HEAD + METRIC))
    assert "unit" not in plain.record() and "x_mm" not in plain.encode("csv").decode()


@pytest.mark.parametrize(
    ("cell", "code", "step"), [("600x400mm", 4, 600), ("60x40cm", 5, 60), ("2x1ft", 2, 2), ("4x4in", 1, 4)]
)
def test_dxf_tells_lengths_in_the_unit_of_the_cell(cell: str, code: int, step: float, tmp_path: Path) -> None:
    import ezdxf

    found = p3i.points(p3i.loads(HEAD + METRIC), cell=parse_cell(cell))
    found.save(tmp_path / "a.dxf")
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    assert drawing.header["$INSUNITS"] == code
    places = np.array([point.dxf.location for point in drawing.modelspace().query("POINT")])[:, :2]
    expected = [(each.true[0], -each.true[1]) for each in found.objects if each.true]
    np.testing.assert_allclose(places, expected, atol=1e-6)
    across = [each.true[0] for each in found.objects if each.true and each.i == 1]
    np.testing.assert_allclose(across, step, rtol=1e-4)
    outlines = [list(line.get_points("xy")) for line in drawing.modelspace().query("LWPOLYLINE")]
    np.testing.assert_allclose(np.mean(outlines, axis=1), places, atol=1e-3 * step)


def test_true_sizes_need_a_lattice_and_a_unit() -> None:
    with pytest.raises(UsageError, match="lattice"):
        p3i.points(p3i.loads(HEAD + RINGS), cell=CellSize(10, 10))
    with pytest.raises(UsageError, match="told in"):
        CellSize(10, 10, "furlong")
