"""Cost of a map: a picture with its numbers, memory for the cells alone, the exact fit's sigma."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.sample_map_cost import map_cost, picture_of
from tests.support.benchmark import check_complete


def test_a_map_needs_memory_for_its_cells_and_is_as_near_as_asked() -> None:
    found = map_cost((8,), exact=101)
    check_complete(picture_of(found))
    assert np.max(found.off_deg) < 0.05
    assert found.seconds.min() > 0
    assert found.exact_s > 0
    # 99 values of 4 bytes a cell, as much again for a few pictures, and the tables.
    assert found.megabytes[-1] < 30 + 3 * 400 * found.cells[-1] / 1e6
