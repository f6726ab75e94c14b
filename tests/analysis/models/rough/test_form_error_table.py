"""The tabulated integral keeps its stated error between its nodes."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.rough.form_error_table import ERROR, tabulated_brdf
from tests.support.models.geometries import special_directions


@pytest.mark.parametrize("sigma_deg", [0.0, 0.4, 2.2, 3.0, 7.0, 23.0, 41.0, 60.0])
@pytest.mark.parametrize("albedo", [0.02, 1.0])
def test_interpolation_keeps_the_stated_error(sigma_deg: float, albedo: float) -> None:
    geometry = special_directions(1500)
    exact = MODELS["oren_nayar_exact"].brdf(geometry, albedo=albedo, sigma_deg=sigma_deg)
    off = np.abs(tabulated_brdf(geometry, albedo, sigma_deg) / exact - 1)
    assert off.max() <= ERROR
    assert np.quantile(off, 0.99) <= 1e-3
