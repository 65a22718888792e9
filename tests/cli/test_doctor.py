"""`p3i doctor`: versions as the packages themselves tell them, also where a library is broken."""

import json
import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from p3i import __version__
from p3i.cli.main import run


def doctor(capsys: pytest.CaptureFixture[str]) -> dict:
    assert run(["doctor", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_versions_are_those_of_the_installed_packages(capsys) -> None:
    found = doctor(capsys)
    assert found["p3i"] == __version__
    packages = {"numpy": "numpy", "lark": "lark", "click": "click", "pillow": "pillow", "torch": "torch"}
    for name, package in packages.items():
        assert found[name].startswith(metadata.version(package).partition("+")[0])
    assert found["python"].endswith(".".join(map(str, sys.version_info[:3])))
    assert str(os.cpu_count()) in found["cpus"] and "threads" in found["torch"]


def test_people_read_the_same_facts_line_by_line(capsys) -> None:
    found = doctor(capsys)
    assert run(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(found)
    for name, line in zip(found, lines, strict=True):
        assert line.startswith(name)
    assert any(metadata.version("numpy") in line for line in lines)


def test_every_extra_that_users_install_is_told(capsys) -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    assert doctor(capsys)["extras"].keys() == project["optional-dependencies"].keys() - {"bench", "dev"}


def test_an_extra_that_is_missing_is_told(capsys, monkeypatch) -> None:
    honest = metadata.version

    def version(package: str) -> str:
        if package == "ezdxf":
            raise metadata.PackageNotFoundError(package)
        return honest(package)

    monkeypatch.setattr(metadata, "version", version)
    assert doctor(capsys)["extras"]["cad"] == "not installed"


@pytest.mark.parametrize(
    "broken", ["raise ImportError('libcudart.so is missing')", "1 / 0", "raise SystemExit"]
)
def test_a_broken_torch_is_a_finding_and_no_failure(broken: str, tmp_path: Path) -> None:
    (tmp_path / "torch.py").write_text(broken)
    path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])])
    done = subprocess.run(
        [sys.executable, "-m", "p3i", "doctor", "--json"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["torch"].startswith("does not work: ")
    assert found["numpy"] == metadata.version("numpy")
