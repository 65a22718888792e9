import numpy as np
import pytest
import torch

from p3i.errors import FileError
from p3i.vision.network import centred, known_blocks, load_weights

SHAPES = {"a.weight": (2, 3), "a.bias": (2,)}


def good() -> dict[str, torch.Tensor]:
    return {"a.weight": torch.ones(2, 3), "a.bias": torch.zeros(2), "rest": torch.zeros(9)}


def test_the_tensors_asked_for_are_loaded_and_no_others(tmp_path):
    torch.save(good(), tmp_path / "w.pth")
    found = load_weights(tmp_path / "w.pth", SHAPES)
    assert found.keys() == SHAPES.keys()
    assert torch.equal(found["a.weight"], torch.ones(2, 3))


class Trap:
    """Unpickling it would write a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


def test_a_weight_file_cannot_run_code(tmp_path):
    torch.save({"a.weight": Trap(tmp_path / "ran")}, tmp_path / "w.pth")
    with pytest.raises(FileError, match="never code"):
        load_weights(tmp_path / "w.pth", SHAPES)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"a.bias": torch.zeros(2)}, r"has no a\.weight"),
        (
            {"a.weight": torch.ones(3, 2), "a.bias": torch.zeros(2)},
            r"a\.weight is \(3, 2\), expected \(2, 3\)",
        ),
        ({"a.weight": "text", "a.bias": torch.zeros(2)}, r"has no a\.weight"),
        ([1, 2], "holds a list"),
    ],
)
def test_other_weights_are_refused_with_the_difference(tmp_path, content, message):
    torch.save(content, tmp_path / "w.pth")
    with pytest.raises(FileError, match=message):
        load_weights(tmp_path / "w.pth", SHAPES)


def test_files_that_are_no_weights_are_refused(tmp_path):
    with pytest.raises(FileError, match=r"no file .*missing\.pth"):
        load_weights(tmp_path / "missing.pth", SHAPES)
    with pytest.raises(FileError, match="is a folder"):
        load_weights(tmp_path, SHAPES)
    torch.save(good(), tmp_path / "w.pth")
    data = (tmp_path / "w.pth").read_bytes()
    for content in (b"", b"hello", data[: len(data) // 2]):
        (tmp_path / "w.pth").write_bytes(content)
        with pytest.raises(FileError) as caught:
            load_weights(tmp_path / "w.pth", SHAPES)
        assert "\n" not in str(caught.value)


def test_centring_reads_a_ramp_further_on():
    ramp = torch.arange(8.0).expand(1, 5, 8)
    torch.testing.assert_close(centred(ramp, 0.125)[0, 0, :7], torch.arange(7.0) + 0.125)
    torch.testing.assert_close(centred(ramp.transpose(1, 2), 0.25)[0, :7, 0], torch.arange(7.0) + 0.25)
    assert centred(torch.ones(1, 1, 1), 0.5).shape == (1, 1, 1)


def test_a_block_is_known_where_all_that_it_reads_is():
    valid = np.random.default_rng(0).random((50, 70)) > 0.004
    found = known_blocks(valid, stride=4, before=5, after=9, size=(13, 18))
    for row in range(13):
        for column in range(18):
            top, left, bottom, right = 4 * row - 5, 4 * column - 5, 4 * row + 9, 4 * column + 9
            inside = top >= 0 and left >= 0 and bottom < 50 and right < 70
            expected = inside and valid[top : bottom + 1, left : right + 1].all()
            assert bool(found[row, column]) == expected
    assert found.any()
