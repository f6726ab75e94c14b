"""Cost of a map: linear in the cells, memory for the cells alone, and the exact fit's sigma."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.sample_map_cost import map_cost, picture_of
from tests.support.benchmark import check_complete


def test_a_map_is_far_cheaper_than_exact_fits_and_as_near_as_asked() -> None:
    found = map_cost((4, 8), exact=101)
    check_complete(picture_of(found))
    assert np.max(found.off_deg) < 0.05
    assert found.seconds[-1] < found.cells[-1] * found.exact_s
    # 99 values of 4 bytes a cell, as much again for a few pictures, and the tables.
    assert found.megabytes[-1] < 30 + 3 * 400 * found.cells[-1] / 1e6
