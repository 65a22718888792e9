"""What starts without torch, measured in fresh processes."""

import subprocess
import sys

import pytest

from p3i.cli.main import COMMANDS

HEAVY = ("torch", "numpy", "cv2", "PIL", "rich")


def loaded_after(code: str) -> set[str]:
    """The heavy packages that a fresh interpreter has loaded after `code`."""
    script = f"import sys\n{code}\nprint('loaded:', *(n for n in {HEAVY!r} if n in sys.modules))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.rsplit("loaded:", 1)[1].split())


@pytest.mark.parametrize(
    "words",
    [["--help"], ["--version"], ["nonsense"], *([name, "--help"] for name in COMMANDS)],
    ids=" ".join,
)
def test_help_loads_nothing_heavy(words: list[str]) -> None:
    assert loaded_after(f"from p3i.cli.main import run; run({words!r})") == set()


@pytest.mark.parametrize("words", [["check"], ["fmt", "--check"], ["expand"]], ids=" ".join)
def test_the_commands_on_text_load_nothing_heavy(words: list[str], tmp_path) -> None:
    program = tmp_path / "a.p3p"
    program.write_text("SetCameraPose(rx=0, ry=0)\nfor j in range(0, 3):\n    Draw(x=10*j, y=5*j)\n")
    assert loaded_after(f"from p3i.cli.main import run; run({[*words, str(program)]!r})") == set()


def test_the_functions_on_text_load_nothing_heavy() -> None:
    code = (
        "import p3i\n"
        "text = 'SetCameraPose(rx=0, ry=0)\\nfor j in range(0, 3):\\n    Draw(x=10*j, y=5*j)\\n'\n"
        "p3i.check(text); p3i.format(p3i.loads(text)); p3i.dumps(p3i.loads(text)); p3i.Program; dir(p3i)"
    )
    assert loaded_after(code) == set()
