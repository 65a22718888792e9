"""The shells of `p3i rectify` and `p3i tile`: what they write and where, and what they refuse."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pil
from PIL import ImageCms

from p3i.cli.main import run
from p3i.vision.image import read_image
from p3i.vision.write import write_image

GRID = """SetCameraPose(rx=-40, ry=10)
for i in range(0, 4):
    for j in range(0, 4):
        Draw(x=9*i - 13, y=9*j - 13)
"""
GOLDEN = Path(__file__).parent / "golden"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a program and a photo of blocks."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "grid.p3p").write_text(GRID)
    random = np.random.default_rng(0)
    blocks = random.integers(40, 220, (12, 16, 3)).repeat(12, axis=0).repeat(12, axis=1).astype(np.uint8)
    write_image(tmp_path / "photo.png", blocks)
    return tmp_path


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.jpeg", "a.tif", "a.tiff", "a.webp"])
@pytest.mark.parametrize("verb", ["rectify", "tile"])
def test_the_suffix_tells_the_kind(folder: Path, verb: str, name: str) -> None:
    assert run([verb, "photo.png", "grid.p3p", "-o", name]) == 0
    kinds = {"png": "PNG", "jpg": "JPEG", "jpeg": "JPEG", "tif": "TIFF", "tiff": "TIFF", "webp": "WEBP"}
    with Pil.open(folder / name) as picture:
        assert picture.format == kinds[name.split(".")[1]]


@pytest.mark.parametrize("verb", ["rectify", "tile"])
def test_the_same_call_writes_the_same_bytes_to_a_file_or_stdout(
    folder: Path, capfdbinary: pytest.CaptureFixture[bytes], verb: str
) -> None:
    assert run([verb, "photo.png", "grid.p3p", "-o", "a.png", "-q"]) == 0
    assert run([verb, "photo.png", "grid.p3p", "-o", "-", "-q"]) == 0
    assert capfdbinary.readouterr().out == (folder / "a.png").read_bytes()


@pytest.mark.parametrize("words", ["rectify --crop same", "rectify --crop all --cell 60x60cm", "tile"])
def test_the_facts_are_the_golden_ones(
    folder: Path, capsys: pytest.CaptureFixture[str], golden: Callable[[Path, str], None], words: str
) -> None:
    verb, *options = words.split()
    assert run([verb, "photo.png", "grid.p3p", *options, "--json", "-", "-q"]) == 0
    text = capsys.readouterr().out
    facts = json.loads(text)
    for measured in ("seam", "cut"):  # not computed: they hang on OpenCV's rounding
        facts.pop(measured, None)
    assert not list(folder.glob("*.tif"))
    name = "-".join([verb, *(option.strip("-") for option in options)])
    golden(GOLDEN / f"{name}.json", json.dumps(facts, indent=1) + "\n")


def test_facts_and_picture_come_of_one_call(folder: Path) -> None:
    assert run(["rectify", "photo.png", "grid.p3p", "-o", "a.png", "--json", "a.json", "-q"]) == 0
    facts = json.loads((folder / "a.json").read_text())
    size = read_image(folder / "a.png").size
    assert facts["view"] == [size.width, size.height]
    product = np.array(facts["photo_from_view"]) @ np.array(facts["view_from_photo"])
    np.testing.assert_allclose(product / product[2, 2], np.eye(3), atol=1e-6)


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif"])
def test_profile_exif_and_resolution_are_kept(folder: Path, name: str) -> None:
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    exif = Pil.Exif()
    exif[0x010E] = "a wall"
    with Pil.open(folder / "photo.png") as picture:
        picture.save(folder / "rich.jpg", icc_profile=profile, exif=exif, quality=95)
    assert (
        run(["rectify", "rich.jpg", "grid.p3p", "--cell", "10x10mm", "-o", name, "-q", "--json", "a.json"])
        == 0
    )
    dpi = json.loads((folder / "a.json").read_text())["dpi"]
    with Pil.open(folder / name) as picture:
        assert picture.info["icc_profile"] == profile
        assert picture.getexif()[0x010E] == "a wall"
        assert float(picture.info["dpi"][0]) == pytest.approx(dpi, abs=0.6)


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
def test_sixteen_bits_and_holes_are_kept(folder: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    deep = (np.arange(144 * 192 * 3) % 65_536).astype(np.uint16).reshape(144, 192, 3)
    alpha = np.ones((144, 192), np.float32)
    alpha[60:80, 90:110] = 0
    write_image(folder / "deep.png", deep, alpha=alpha, bits=16)
    assert run(["rectify", "deep.png", "grid.p3p", "--cell", "9x9mm", "-o", name]) == 0
    found = read_image(folder / name)
    assert found.source.bits == 16 and found.source.alpha is not None and not found.valid.all()
    assert run(["rectify", "deep.png", "grid.p3p", "-o", "flat.jpg"]) == 0
    said = capsys.readouterr().err
    assert "white" in said and "8 of 16 bits" in said


def test_an_edited_view_goes_back_and_the_rest_stays(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["rectify", "photo.png", "grid.p3p"]
    assert run([*call, "-o", "view.png"]) == 0
    assert run([*call, "--back", "view.png", "-o", "same.png"]) == 0
    assert "unchanged" in capsys.readouterr().err
    before = read_image(folder / "photo.png").pixels
    np.testing.assert_array_equal(read_image(folder / "same.png").pixels, before)
    with Pil.open(folder / "view.png") as picture:
        edited = picture.copy()
    edited.paste((255, 255, 255), (40, 40, 60, 60))
    edited.save(folder / "edited.png")
    assert run([*call, "--back", "edited.png", "-o", "new.png"]) == 0
    assert "pixels of the photo changed" in capsys.readouterr().err
    changed = (read_image(folder / "new.png").pixels != before).any(axis=2).mean()
    assert 0.001 < changed < 0.1


def test_without_a_program_one_is_searched_for(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_image(folder / "grey.png", np.full((120, 160, 3), 128, np.uint8))
    assert run(["rectify", "grey.png", "-o", "a.png"]) == 5
    assert run(["tile", "grey.png", "-o", "a.png"]) == 5
    assert "too little contrast" in capsys.readouterr().err
    assert not (folder / "a.png").exists()


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ("rectify missing.png grid.p3p -o a.png", 3, "no file missing.png"),
        ("rectify photo.png missing.p3p -o a.png", 3, "missing.p3p"),
        ("rectify grid.p3p grid.p3p -o a.png", 3, "no picture"),
        ("rectify photo.png sketch.p3p -o a.png", 4, "P116"),
        ("rectify photo.png aside.p3p -o a.png", 4, "another photo"),
        ("rectify photo.png none.p3p -o a.png", 4, "draws nothing"),
        ("rectify photo.png ring.p3p --cell 1x1m -o a.png", 2, "needs a lattice"),
        ("rectify photo.png grid.p3p -o a.gif", 2, ".png"),
        ("rectify photo.png grid.p3p -o none/a.png", 3, "no folder"),
        ("rectify photo.png grid.p3p -o .", 2, "is read here"),
        ("rectify photo.png grid.p3p -o photo.png --force", 2, "is read here"),
        ("rectify photo.png grid.p3p -o a.png --json a.png", 2, "both be written"),
        ("rectify photo.png grid.p3p -o a.png --crop most", 2, "crop"),
        ("rectify photo.png grid.p3p -o a.png --scale 0", 2, "scale"),
        ("rectify photo.png grid.p3p -o a.png --scale nan", 2, "scale"),
        ("rectify photo.png grid.p3p -o a.png --scale 90", 2, "--max-px"),
        ("rectify photo.png grid.p3p -o a.png --max-px 0", 2, "limit"),
        ("rectify photo.png grid.p3p -o a.png --cell 6x6px", 2, "600x600mm"),
        ("rectify photo.png grid.p3p -o a.png --focal 0", 2, "focal"),
        ("rectify photo.png grid.p3p -o a.png --tolerance 3", 2, "--back"),
        ("rectify photo.png grid.p3p -o a.png --back photo.png", 2, "but the view is"),
        ("rectify photo.png grid.p3p -o a.png --back missing.png", 3, "missing.png"),
        ("rectify - - -o a.png", 2, "standard input"),
        ("tile photo.png spiral.p3p -o a.png", 4, "spiral"),
        ("tile photo.png row.p3p -o a.png", 4, "one row"),
        ("tile photo.png grid.p3p -o a.png --size 2x2", 2, "at least 4"),
        ("tile photo.png grid.p3p -o a.png --repeat 0x2", 2, "repeated"),
        ("tile photo.png grid.p3p -o a.png --repeat 3", 2, "3x2"),
        ("tile photo.png grid.p3p -o a.png --size 9999x9999 --repeat 9x9", 2, "--max-px"),
        ("tile photo.png grid.p3p -o a.png --from worst", 2, "worst"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence(
    folder: Path, capsys: pytest.CaptureFixture[str], words: str, code: int, sentence: str
) -> None:
    (folder / "sketch.p3p").write_text("Draw(x=??, y=2)\n")
    (folder / "aside.p3p").write_text(GRID.replace("9*i - 13", "9*i + 60"))
    (folder / "none.p3p").write_text("for i in range(0, 0):\n    Draw(x=9*i, y=0)\n")
    (folder / "row.p3p").write_text("for i in range(0, 3):\n    Draw(x=9*i, y=0)\n")
    (folder / "ring.p3p").write_text("for i in range(0, 6):\n    Draw(x=9*Cos(60*i), y=9*Sin(60*i))\n")
    (folder / "spiral.p3p").write_text("for i in range(1, 6):\n    Draw(x=5*i*Cos(60*i), y=5*i*Sin(60*i))\n")
    assert run(words.split()) == code
    shown = capsys.readouterr().err
    assert sentence in shown
    assert "Traceback" not in shown
    assert not list(folder.glob("a.*")) and not list(folder.glob(".a*")), "nothing half written"


@pytest.mark.parametrize("verb", ["rectify", "tile"])
def test_nothing_is_overwritten_without_force_and_errors_come_as_json(
    folder: Path, capsys: pytest.CaptureFixture[str], verb: str
) -> None:
    (folder / "a.png").write_bytes(b"mine")
    assert run([verb, "photo.png", "grid.p3p", "-o", "a.png", "--error-format", "json"]) == 3
    said = json.loads(capsys.readouterr().err)
    assert said["code"] == 3 and "--force" in said["error"]
    assert (folder / "a.png").read_bytes() == b"mine"
    assert run([verb, "photo.png", "grid.p3p", "-o", "a.png", "--force", "-q"]) == 0
    assert capsys.readouterr().err == ""
    assert run([verb, "photo.png", "grid.p3p", "-o", "a.png", "--force", "-v"]) == 0
    assert " px" in capsys.readouterr().err
