"""The maps that the search compares cells on."""

import numpy as np

from p3i.search.config import SearchConfig
from p3i.search.look.evidence import Evidence
from p3i.vision.image import Image


def test_a_cell_that_runs_to_the_horizon_is_blurred_no_more_than_one_as_large_as_the_map():
    pixels = np.random.default_rng(0).random((240, 320, 3), dtype=np.float32)
    evidence = Evidence(Image(pixels, np.ones((240, 320), bool)), SearchConfig(), 35.0)
    assert evidence.level_for(1e6) is evidence.level_for(320.0)
