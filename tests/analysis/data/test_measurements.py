"""Measurements: invalid values are reported by name; seeded scans are as stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.measurements import Measurements, SharedError
from tests.support.analysis.seeded_scan import scan


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"u_random": np.zeros(2)}, "u_random = 0 1/sr"),
        ({"u_random": None, "u_dphi_deg": 0.01}, "u_random must be stated"),
        ({"u_dphi_deg": -1.0}, "u_dphi_deg = -1"),
        ({"brdf": np.array([0.2, np.nan])}, "brdf holds a value that is not finite"),
        ({"theta_i_deg": np.array([30.0, 95.0])}, "theta_i = 95"),
        ({"shared": (SharedError.common_to_all("tile", 0.1, 3),)}, "tile has the shape"),
        ({"shared": (SharedError.common_to_all("tile", np.nan, 2),)}, "tile holds a value"),
    ],
)
def test_wrong_measurements_are_named(change: dict[str, object], words: str) -> None:
    m = Measurements.bare(30, [0, 20], 0, 0.2, 1e-3)
    with pytest.raises(ValueError, match=words):
        replace(m, **change)  # type: ignore[arg-type]  # wrong on purpose


def test_a_seeded_scan_has_the_stated_truth() -> None:
    m = scan("lambert", 1, u_relative=1e-12, u_tile=0.0, u_deg=0.0, albedo=0.5)
    assert m.size == 96  # 99 less the one next to the lamp at each incidence
    np.testing.assert_allclose(m.brdf, 0.5 / np.pi, rtol=1e-10)
    assert np.unique(m.lamp_setting).size == 3


def test_all_fits_to_measurements_share_one_geometry_and_what_models_keep_of_it() -> None:
    m = scan("oren_nayar", 1, albedo=0.8, sigma_deg=25.0)
    assert m.geometry is m.geometry
    closer = replace(m, theta_r_deg=m.theta_r_deg / 2)
    np.testing.assert_array_equal(closer.geometry.theta_r_deg, m.geometry.theta_r_deg / 2)
