"""Levels of the stored error maps."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analysis.models.error_maps import errors_of, levels_of
from instrument.geometry import FloatArray


@given(errors=st.lists(st.floats(0, 1e3), min_size=1))
def test_levels_round_up_by_at_most_one_step(errors: list[float]) -> None:
    """The scale has eight levels an octave, from 1e-8."""
    given_errors: FloatArray = np.array(errors)
    stored = errors_of(levels_of(given_errors))
    assert np.all(stored >= given_errors * (1 - 1e-9))
    usual = (given_errors > 1e-8) & (given_errors < 10)
    assert np.all(stored[usual] <= given_errors[usual] * 2 ** (1 / 8) * (1 + 1e-9))
