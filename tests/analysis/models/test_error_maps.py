"""Levels of the stored error maps."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analysis.models.error_maps import ABSOLUTE, RELATIVE
from instrument.geometry import FloatArray


@given(errors=st.lists(st.floats(0, 1e3), min_size=1))
def test_levels_round_up_by_at_most_one_step(errors: list[float]) -> None:
    given_errors: FloatArray = np.array(errors)
    for scale in (RELATIVE, ABSOLUTE):
        stored = scale.errors(scale.levels(given_errors))
        assert np.all(stored >= given_errors * (1 - 1e-9))
        usual = (given_errors > scale.least) & (given_errors < 10)
        step = 2 ** (1 / scale.per_octave)
        assert np.all(stored[usual] <= given_errors[usual] * step * (1 + 1e-9))
