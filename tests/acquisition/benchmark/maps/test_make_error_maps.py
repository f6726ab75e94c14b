"""The stored error maps are what their maker computes."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.make_error_maps import error_maps, lobe_maps
from analysis.models.error_maps import ABSOLUTE, RELATIVE, maps


@pytest.mark.slow
def test_the_stored_maps_are_reproduced(slow: bool) -> None:
    relative, absolute = lobe_maps()
    made = {"lobe": RELATIVE.levels(relative), "lobe_absolute": ABSOLUTE.levels(absolute)}
    if slow:
        made = error_maps()
        assert set(made) == set(maps())
    for name, found in made.items():
        levels, stored = found, maps()[name]
        if name == "lobe_absolute":  # below a few ulp of 1, errors are the processor's rounding
            floor = ABSOLUTE.levels(np.array(4 * np.finfo(float).eps))
            levels, stored = np.maximum(found, floor), np.maximum(stored, floor)
        # Rounding may move a value to the next level.
        off = np.abs(levels.astype(int) - stored.astype(int))
        assert off.max() <= 1, name
        assert np.mean(off) < 1e-3, name
