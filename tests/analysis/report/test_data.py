"""Report data: columns and residuals have one entry a point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.analysis.report_data import data_of


@pytest.mark.parametrize("column", ["brdf", "flags", "fitted", "theta_r_deg"])
def test_columns_of_unlike_lengths_are_refused(column: str) -> None:
    data = data_of()
    with pytest.raises(ValueError, match=r"entries for \d+ points"):
        replace(data, **{column: getattr(data, column)[1:]})


def test_residuals_of_another_fit_are_refused() -> None:
    data = data_of()
    with pytest.raises(ValueError, match="17 residuals for 18 points"):
        replace(data, candidates=(replace(data.candidates[1], residuals=np.zeros(17)),))
