"""The stored error maps are what their maker computes."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.make_error_maps import error_maps, smooth_maps
from analysis.models.error_maps import levels_of, maps


@pytest.mark.slow
def test_the_stored_maps_are_reproduced(slow: bool) -> None:
    made = {name: levels_of(errors) for name, errors in smooth_maps().items()}
    if slow:
        made = error_maps()
        assert set(made) == set(maps())
    for name, found in made.items():
        # Rounding may move a value to the next level.
        off = np.abs(found.astype(int) - maps()[name].astype(int))
        assert off.max() <= 1, name
        assert np.mean(off) < 1e-3, name
