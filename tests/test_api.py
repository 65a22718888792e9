"""The functions of the commands: loaded lazily, with one record of options, and headers on their answers."""

import dataclasses
import importlib
import sys
import types
from pathlib import Path

import cv2
import numpy as np
import pytest

import p3i
from p3i.errors import FileError, UsageError
from p3i.search.result import Candidate, StopReason, SynthesisResult

TEXT = """\
SetCameraPose(rx=-30, ry=5)
for i in range(0, 4):
    for j in range(0, 4):
        Draw(x=9*i, y=9*j)
"""


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photos" / "a.png"
    path.parent.mkdir()
    cv2.imwrite(str(path), np.full((48, 64, 3), 128, np.uint8))
    return path


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """Puts a search in place that finds TEXT in every photo, and lists what it was asked."""
    asked: list[tuple] = []

    def synthesize(image, config, *, progress=None, trace=None) -> SynthesisResult:
        asked.append((image, config))
        program = p3i.loads(TEXT)
        return SynthesisResult(
            program=program,
            stop=StopReason.FOUND,
            structure="lattice",
            score=0.7,
            candidates=(
                Candidate(
                    program=program, score=0.7, structure="lattice", focal_mm=31.5, focal_source="exif"
                ),
                Candidate(
                    program=program, score=0.6, structure="circular", focal_mm=50.0, focal_source="pattern"
                ),
            ),
            focal_mm=31.5,
            focal_source="exif",
            features=config.features_used,
            seed=config.seed,
            notes=("of the search",),
        )

    module = types.ModuleType("p3i.search.synthesize")
    module.synthesize = synthesize  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "p3i.search.synthesize", module)
    return asked


@pytest.mark.parametrize("name", p3i.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(p3i, name)
    assert value.__doc__
    assert name in dir(p3i)


def test_the_list_for_type_checkers_is_the_list_at_run_time() -> None:
    assert set(p3i._HOMES) == set(p3i.__all__)
    for name, home in p3i._HOMES.items():
        assert getattr(importlib.import_module(home), name) is getattr(p3i, name)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'synthesise'"):
        p3i.synthesise  # noqa: B018


def test_synth_puts_canvas_focal_photo_and_fit_into_the_header(calls, photo: Path) -> None:
    result = p3i.synth(photo, seed=3, beside=photo.parent.parent / "out")
    header = result.program.header if result.program else None
    assert header is not None
    assert (header.canvas, header.focal_mm, header.image) == ((64, 48), 31.5, "../photos/a.png")
    assert dict(header.fit) == {
        "structure": "lattice",
        "score": 0.7,
        "features": "oriented",
        "focal_from": "exif",
        "seed": 3,
    }
    assert result.candidates[0].program.header == header
    other = result.candidates[1].program.header
    assert other is not None and (other.focal_mm, dict(other.fit)["focal_from"]) == (50.0, "pattern")


def test_synth_takes_an_image_in_memory_and_names_no_photo_then(calls, photo: Path) -> None:
    result = p3i.synth(p3i.read_image(photo))
    assert result.program is not None and result.program.header is not None
    assert result.program.header.image is None


def test_options_change_the_record_that_is_given(calls, photo: Path) -> None:
    p3i.synth(photo, p3i.SearchConfig(seed=1, top=2), seed=5)
    assert calls[0][1] == p3i.SearchConfig(seed=5, top=2)


def test_an_unknown_option_is_refused_by_name(calls, photo: Path) -> None:
    with pytest.raises(UsageError, match="no option 'sead'"):
        p3i.synth(photo, sead=1)


def test_notes_of_the_reader_come_before_those_of_the_search(calls, photo: Path) -> None:
    image = dataclasses.replace(p3i.read_image(photo), notes=("of the reader",))
    assert p3i.synth(image).notes[:2] == ("of the reader", "of the search")


def test_a_mask_as_an_array_hides_pixels(calls, photo: Path) -> None:
    hidden = np.zeros((48, 64), bool)
    hidden[:, :5] = True
    p3i.synth(photo, mask=hidden)
    assert np.array_equal(calls[0][0].valid, ~hidden)


def test_a_mask_of_another_size_is_refused(calls, photo: Path) -> None:
    with pytest.raises(UsageError, match="a mask is bool"):
        p3i.synth(photo, mask=np.zeros((5, 5), bool))


def test_a_mask_that_hides_everything_is_refused(calls, photo: Path) -> None:
    with pytest.raises(UsageError, match="leave nothing"):
        p3i.synth(photo, mask=np.ones((48, 64), bool))


def test_a_missing_photo_is_a_file_error(calls, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="nowhere"):
        p3i.synth(tmp_path / "nowhere.jpg")


def test_programs_are_written_and_read_back(tmp_path: Path) -> None:
    program = p3i.loads(TEXT)
    p3i.dump(program, tmp_path / "a.p3p")
    assert p3i.load(tmp_path / "a.p3p") == program
    assert p3i.dumps(program) == p3i.format(program) == TEXT
