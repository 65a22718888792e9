"""Programs from wherever they come: text, drawings that carry them, drawings saved anew by others, pipes."""

import io
import os
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image as Pil
from PIL.PngImagePlugin import PngImageFile, PngInfo

import p3i
from p3i.carried import kind_of, read_either, read_program
from p3i.errors import FileError, ProgramError
from p3i.vision.image import Image
from p3i.vision.write import write_image

TEXT = """\
SetCameraPose(rx=-20, ry=10)
for i in range(0, 4):
    for j in range(0, 3):
        Draw(x=14*i - 20, y=14*j - 14)
"""


@pytest.fixture
def drawn(tmp_path: Path) -> Path:
    path = tmp_path / "drawn.png"
    p3i.render(p3i.loads(TEXT), size=p3i.Size(64, 48)).save(path)
    return path


@pytest.mark.parametrize("packed", ["itxt", "itxt compressed", "ztxt", "text", "text after the pixels"])
def test_a_drawing_saved_anew_by_another_program_keeps_its_program(drawn: Path, packed: str) -> None:
    with Pil.open(drawn) as picture:
        (keyword,) = [str(key) for key, value in picture.info.items() if "SetCameraPose" in str(value)]
        text, pixels = str(picture.info[keyword]), picture.copy()
    entries = PngInfo()
    if packed.startswith("itxt"):
        entries.add_itxt(keyword, text, zip=packed.endswith("compressed"))
    else:
        entries.add_text(keyword, text, zip=packed == "ztxt")
    pixels.info.clear()
    buffer = io.BytesIO()
    pixels.save(buffer, "PNG", pnginfo=entries)
    data = buffer.getvalue()
    if packed == "text after the pixels":
        at = data.index(b"tEXt") - 4
        chunk = data[at : at + 12 + int.from_bytes(data[at : at + 4], "big")]
        note = io.BytesIO()
        others = PngInfo()
        others.add_text("Software", "a painter")
        pixels.save(note, "PNG", pnginfo=others)
        data = note.getvalue()[:-12] + chunk + note.getvalue()[-12:]
    drawn.write_bytes(data)
    assert read_program(drawn) == p3i.loads(TEXT)


def test_a_program_is_read_from_text_svg_and_standard_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.p3p").write_text(TEXT)
    p3i.render(p3i.loads(TEXT)).save(tmp_path / "a.svg")
    assert read_program(tmp_path / "a.p3p") == read_program(tmp_path / "a.svg") == p3i.loads(TEXT)
    for name in ("a.p3p", "a.svg"):
        data = (tmp_path / name).read_bytes()
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(data)))
        assert read_program("-") == p3i.loads(TEXT)


def test_a_plain_png_is_told_from_a_drawing_without_decoding_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_image(tmp_path / "photo.png", np.zeros((6, 9, 3), np.uint8), text={"Comment": "a wall"})
    monkeypatch.setattr(PngImageFile, "load", lambda *_: pytest.fail("decoded"))
    assert kind_of(tmp_path / "photo.png") == "photo"


def test_what_is_read_may_be_a_photo_or_a_program(drawn: Path, tmp_path: Path) -> None:
    write_image(tmp_path / "photo.png", np.zeros((6, 9, 3), np.uint8))
    (tmp_path / "grey.pgm").write_bytes(b"P5 4 4 255\n" + bytes(range(100, 116)))
    assert read_either(drawn) == p3i.loads(TEXT)
    photo, grey = read_either(tmp_path / "photo.png"), read_either(tmp_path / "grey.pgm")
    assert isinstance(photo, Image) and (photo.size.width, photo.size.height) == (9, 6)
    assert isinstance(grey, Image) and grey.size.width == 4


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
@pytest.mark.parametrize("kind", ["program", "photo"])
def test_a_named_pipe_is_opened_once(kind: str, tmp_path: Path) -> None:
    write_image(tmp_path / "photo.png", np.zeros((6, 9, 3), np.uint8))
    data = TEXT.encode() if kind == "program" else (tmp_path / "photo.png").read_bytes()
    os.mkfifo(tmp_path / "pipe")
    writer = threading.Thread(target=(tmp_path / "pipe").write_bytes, args=(data,), daemon=True)
    writer.start()
    found: list[object] = []
    reader = threading.Thread(target=lambda: found.append(read_either(tmp_path / "pipe")), daemon=True)
    reader.start()
    reader.join(10)
    assert found, "the pipe was opened again, and nobody writes to it any more"
    assert isinstance(found[0], Image if kind == "photo" else p3i.Program)


def test_a_picture_without_a_program_is_no_program(tmp_path: Path) -> None:
    write_image(tmp_path / "plain.png", np.zeros((4, 4, 3), np.uint8))
    (tmp_path / "plain.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    (tmp_path / "broken.svg").write_text("<svg")
    (tmp_path / "broken.png").write_bytes((tmp_path / "plain.png").read_bytes()[:30])
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0 and so on")
    (tmp_path / "page.pdf").write_bytes(b"%PDF-1.4")
    for name, sentence in [
        ("plain.png", "carries no program"),
        ("plain.svg", "carries no program"),
        ("broken.svg", "damaged"),
        ("broken.png", "carries no program"),
        ("photo.jpg", "only PNG and SVG"),
        ("page.pdf", "only PNG and SVG"),
        ("missing.p3p", "no file"),
        ("", "folder"),
    ]:
        with pytest.raises(FileError, match=sentence):
            read_program(tmp_path / name)


def test_a_program_with_errors_is_shown_with_its_place(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.p3p"
    wrong.write_text("Draw(x=i*j, y=0)")
    with pytest.raises(ProgramError, match=r"wrong\.p3p:1"):
        read_program(wrong)
    carried = tmp_path / "carried.png"
    write_image(carried, np.zeros((4, 4, 3), np.uint8), text={"p3i-program": "Draw(x=i*j, y=0)"})
    with pytest.raises(ProgramError, match=r"carried\.png:1"):
        read_program(carried)
