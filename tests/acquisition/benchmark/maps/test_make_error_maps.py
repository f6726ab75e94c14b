"""The stored error maps are what their maker computes."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.maps.make_error_maps import error_maps, smooth_maps
from acquisition.benchmark.maps.smooth_dielectric import GRID
from analysis.models.error_maps import levels_of, maps

CELLS = 3  # of n, in a normal run


@pytest.mark.slow
def test_the_stored_maps_are_reproduced(slow: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without --slow those of the smooth dielectric, in some of the cells of its index n."""
    stored = dict(maps())
    if slow:
        made = error_maps()
        assert set(made) == set(stored)
    else:
        first = np.random.default_rng(4).integers(GRID["n"].size - CELLS)
        some = slice(first, first + CELLS)
        monkeypatch.setitem(GRID, "n", GRID["n"][first : first + CELLS + 1])
        made = {name: levels_of(errors) for name, errors in smooth_maps().items()}
        stored = {name: stored[name][:, some] for name in made}
    for name, found in made.items():
        # Rounding may move a value to the next level.
        off = np.abs(found.astype(int) - stored[name].astype(int))
        assert off.max() <= 1, name
        assert np.mean(off) < 1e-3, name
