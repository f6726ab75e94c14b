"""The stored table of the exact integral is what its maker computes."""

from __future__ import annotations

import numpy as np

from acquisition.benchmark.maps.make_form_error_table import form_error_table
from analysis.models.rough.form_error_table import FILE, GRID


def test_the_stored_table_is_reproduced() -> None:
    with np.load(FILE) as stored:
        # The table was made with another quadrature, which keeps 1e-6 of the radiance as well.
        np.testing.assert_allclose(
            stored["direct_and_twice"], form_error_table(), rtol=1e-6, atol=2e-6
        )
        for name, nodes in GRID.items():
            np.testing.assert_array_equal(stored[name], nodes)
