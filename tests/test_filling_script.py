"""The script of the filling benchmark: what its searches and fills see, its journal, its report."""

import dataclasses
import importlib
import json
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_benchmarks import SCRIPTS

import p3i
from p3i.vision.image import Image


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(SCRIPTS[0].parent))


def module(name: str) -> types.ModuleType:
    return importlib.import_module(name)


def rows_of(l1: dict[str, list[float]], **changes: Any) -> list[Any]:
    """A row for each method and photo, of one kind of hole."""
    row = module("filling.tables").Row
    plain = {"drawn": False, "hole": "1 cell", "pixels": 100, "psnr": 30.0, "ssim": 0.9, "sharp": 0.5}
    plain |= {"sharp_pattern": 0.5, "seam": 1.0, "cpu_s": 2.0, "first": True} | changes
    return [
        row(photo=f"photo {k}", method=method, l1=value, **plain)
        for method, values in l1.items()
        for k, value in enumerate(values)
    ]


def test_the_report_compares_over_the_same_holes_and_is_markdown() -> None:
    rows = rows_of({"stack": [4.0, 6.0, 8.0], "npn": [3.8, 5.7, 8.8], "patchmatch": [8.0, 12.0]})
    rows += rows_of({"stack": [9.0], "npn": [9.0]}, hole="side missing", first=False, cpu_s=1.0)
    told = module("filling.tables").report(rows, ("stack", "npn", "patchmatch"))
    assert "### Holes in photos" in told and "### Photos completed" in told and "scenes" not in told
    assert "| stack | 3 | 3 | 6.0 | 4.0 to 8.0 | 6.0 |" in told
    # The third photo was filled by two only: 5 against 10, 6 against 6.1.
    assert "| 1 cell | 0.98 (" in told and "0.50 (0.50 to 0.50) |" in told
    assert "npn below stack in L1 on 67% of 3 photos, 1.7% above it on the mean" in told
    assert "patchmatch below stack in L1 on 0% of 2 photos, 100.0% above it" in told
    assert "1.00 (1.00 after the first)" in told
    for table in (part for part in told.split("\n\n") if part.startswith("|")):
        assert len({line.count("|") for line in table.splitlines()}) == 1


@pytest.fixture
def benchmark(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> types.SimpleNamespace:
    """The script over a set of one scene, with a search and a fill that write down what they were given."""
    script = module("inpainting")
    p3i.examples(tmp_path / "set", lattices=1, rings=0, hybrids=0)
    truth = p3i.load(next((tmp_path / "set" / "programs").iterdir()))
    seen = types.SimpleNamespace(unknown=[], filled=[], script=script, folder=tmp_path)

    def found(_photo: object, *, mask: np.ndarray) -> types.SimpleNamespace:
        seen.unknown.append(mask)
        return types.SimpleNamespace(program=truth)

    def fill(photo: Image, _program: p3i.Program, hole: np.ndarray) -> np.ndarray:
        assert not photo.pixels[hole].any()
        seen.filled.append(hole)
        return photo.pixels

    def run(*arguments: str) -> None:
        monkeypatch.setattr(sys, "argv", ["inpainting.py", str(tmp_path / "set"), *arguments])
        script.main()

    monkeypatch.setattr(p3i, "synth", found)
    monkeypatch.setattr(script, "fills", lambda methods, _options: dict.fromkeys(methods, fill))
    seen.run = run
    return seen


def test_no_search_and_no_fill_sees_a_hidden_pixel(
    benchmark: types.SimpleNamespace, capsys: pytest.CaptureFixture[str]
) -> None:
    benchmark.run("--methods", "stack", "--pictures", str(benchmark.folder / "strips"))
    assert len(benchmark.unknown) > 3
    for hole in benchmark.filled:
        assert any(mask[hole].all() for mask in benchmark.unknown)
    assert len(list((benchmark.folder / "strips").glob("*.png"))) == len(benchmark.filled)
    assert f"1 pictures with {len(benchmark.filled)} holes" in capsys.readouterr().out


def test_together_no_fill_sees_a_pixel_that_the_search_did_not(
    benchmark: types.SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Any] = []

    def fills(methods: list[str], options: dict[str, Any]) -> dict[str, Any]:
        given.append(options["checkpoint"])

        def fill(photo: Image, _program: p3i.Program, hole: np.ndarray) -> np.ndarray:
            hidden = benchmark.unknown[-1]
            assert not photo.pixels[hidden].any() and np.array_equal(photo.valid, ~hidden)
            benchmark.filled.append(hole)
            return photo.pixels

        return dict.fromkeys(methods, fill)

    monkeypatch.setattr(benchmark.script, "fills", fills)
    journal = benchmark.folder / "rows.jsonl"
    benchmark.run("--methods", "npn", "--together", "--out", str(journal))
    rows = [line for line in map(json.loads, journal.read_text().splitlines()) if "method" in line]
    assert len(rows) == len(benchmark.filled) > len(benchmark.unknown) == len(set(given))
    assert sum(row["first"] for row in rows) == len(benchmark.unknown)
    with pytest.raises(SystemExit, match="other settings"):
        benchmark.run("--methods", "npn", "--out", str(journal))


def test_photos_that_give_no_hole_are_told_of(benchmark: types.SimpleNamespace) -> None:
    for arguments in (["--only", "moon"], ["--holes", "quarter of ring"]):
        with pytest.raises(SystemExit, match="no hole was cut"):
            benchmark.run(*arguments)


def test_a_journal_is_gone_on_with_and_one_of_another_seed_is_refused(
    benchmark: types.SimpleNamespace,
) -> None:
    journal = benchmark.folder / "rows.jsonl"
    chosen = ("--holes", "1 cell", "box of 1.2", "--out", str(journal))
    benchmark.run("--methods", "stack", *chosen)
    searches, fills = len(benchmark.unknown), len(benchmark.filled)
    assert searches >= 1 and fills == 2
    with journal.open("a", encoding="utf-8") as stream:
        stream.write('{"photo": "cut sh')
    benchmark.run("--methods", "stack", "telea", *chosen)
    assert len(benchmark.unknown) == searches and len(benchmark.filled) == 2 * fills
    lines = journal.read_text().splitlines()
    assert sum('"telea"' in line for line in lines) == fills == sum('"stack"' in line for line in lines)
    before = journal.read_bytes()
    with pytest.raises(SystemExit, match="other settings"):
        benchmark.run("--methods", "stack", "--seed", "1", *chosen)
    assert journal.read_bytes() == before


def test_an_answer_out_of_tolerance_is_counted_and_nothing_is_filled(
    benchmark: types.SimpleNamespace, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = p3i.loads("SetCameraPose(rx=0, ry=0)\nfor i in range(0, 9):\n    for j in range(0, 9):\n"
                      "        Draw(x=3*i, y=3*j)\n")  # fmt: skip
    monkeypatch.setattr(p3i, "synth", lambda *_, **__: types.SimpleNamespace(program=wrong))
    benchmark.run("--methods", "stack", "--holes", "1 cell")
    assert not benchmark.filled
    assert "with 1 holes in 1 searches; beside 1 of them no program" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["a list", "a record", "a text"])
def test_a_file_that_is_no_journal_is_refused(benchmark: types.SimpleNamespace, name: str) -> None:
    path = benchmark.folder / name
    path.write_text({"a list": "[1, 2]\n", "a record": '{"photos": 3}\n', "a text": "Draw(x=1)"}[name])
    before = path.read_bytes()
    with pytest.raises(SystemExit, match="journal"):
        benchmark.run("--methods", "stack", "--holes", "1 cell", "--out", str(path))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "arguments", [["--every", "0"], ["--photos", "0"], ["--scenes", "-1"], ["--report"], ["--holes", "moon"]]
)
def test_wrong_arguments_end_with_2(benchmark: types.SimpleNamespace, arguments: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        benchmark.run(*arguments)
    assert ended.value.code == 2


def test_a_row_survives_its_journal() -> None:
    (row,) = rows_of({"stack": [1.5]})
    assert module("filling.tables").Row(**json.loads(json.dumps(dataclasses.asdict(row)))) == row
