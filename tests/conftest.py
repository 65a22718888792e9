"""What all tests share: golden files, and strategies.py as a module."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # `import strategies`; importlib mode adds no path by itself


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="Rewrite golden files; refused under CI.")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--update-golden") and os.environ.get("CI", "").lower() in {"1", "true", "yes"}:
        raise pytest.UsageError("--update-golden is refused under CI: golden files are reviewed by eye")


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Callable[[Path, str], None]:
    """`golden(path, text)` holds `text` to the file, or writes it under --update-golden."""

    def hold(path: Path, text: str) -> None:
        if request.config.getoption("--update-golden"):
            path.write_bytes(text.encode())
        assert path.exists(), f"no golden file {path.name}; --update-golden writes it"
        assert text == path.read_bytes().decode(), f"{path.name} differs; look, then --update-golden"

    return hold
