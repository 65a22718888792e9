import cv2
import pytest
import torch

from p3i.vision.threads import limit_threads


def test_both_libraries_are_limited():
    before = torch.get_num_threads(), cv2.getNumThreads()
    try:
        limit_threads(2)
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (2, 2)
        limit_threads()
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (1, 1)
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


def test_no_thread_at_all_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        limit_threads(0)
