"""What stands in one place only, so that two conventions can never meet."""

import re
from pathlib import Path

import pytest

import p3i.vision.warp

PACKAGE = Path(p3i.vision.warp.__file__).parents[1]


@pytest.mark.parametrize(
    ("call", "places"),
    [
        (r"grid_sample\(", ["vision/warp.py"]),
        (r"\bimdecode\(", ["vision/decode.py"]),
        (r"\bimread\(", []),
        (r"\bPil\.open\(|\bImage\.open\(", ["vision/decode.py"]),
        (r"BGR2RGB|RGB2BGR|\[:, :, ::-1\]|\[\.\.\., ::-1\]", []),
    ],
)
def test_pictures_are_decoded_sampled_and_turned_to_rgb_in_one_place(call, places):
    found = [
        path.relative_to(PACKAGE).as_posix()
        for path in sorted(PACKAGE.rglob("*.py"))
        for _ in re.findall(call, path.read_text(encoding="utf-8"))
    ]
    assert found == places


def test_the_one_grid_sample_writes_its_alignment_out():
    text = (PACKAGE / "vision" / "warp.py").read_text(encoding="utf-8")
    (call,) = re.findall(r"grid_sample\([^)]*\)", text)
    assert "align_corners=False" in call
