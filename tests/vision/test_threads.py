from collections.abc import Iterator

import cv2
import pytest
import torch

from p3i.vision.threads import limit_threads, limited_threads


def counts() -> tuple[int, int]:
    return torch.get_num_threads(), cv2.getNumThreads()


@pytest.fixture(autouse=True)
def given_back() -> Iterator[None]:
    before = counts()
    yield
    torch.set_num_threads(before[0])
    cv2.setNumThreads(before[1])


def test_both_libraries_are_limited() -> None:
    limit_threads(2)
    assert counts() == (2, 2)
    limit_threads()
    assert counts() == (1, 1)


def test_a_limit_ends_with_its_block_however_that_ends() -> None:
    limit_threads(3)
    with limited_threads(2):
        assert counts() == (2, 2)
        with pytest.raises(RuntimeError), limited_threads(1):
            assert counts() == (1, 1)
            raise RuntimeError
        assert counts() == (2, 2)
        with limited_threads(None):
            assert counts() == (2, 2)
    assert counts() == (3, 3)


def test_no_thread_at_all_is_refused() -> None:
    before = counts()
    with pytest.raises(ValueError, match="at least one"):
        limit_threads(0)
    with pytest.raises(ValueError, match="at least one"), limited_threads(0):
        pass
    assert counts() == before
