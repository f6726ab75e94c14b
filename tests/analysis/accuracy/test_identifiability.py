"""The condition of a sweep predicts which parameters a fit determines."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.accuracy.identifiability import LIMIT, condition, condition_map, sweep
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.geometry import Geometry

VALUES = {"albedo": 0.8, "sigma_deg": 20.0}


def noisy(geometry: Geometry, seed: int) -> Measurements:
    f = MODELS["oren_nayar"].brdf(geometry, **VALUES).ravel()
    noise = np.random.default_rng(seed).standard_normal(f.size)
    return Measurements.bare(
        geometry.theta_i_deg.ravel(), geometry.theta_r_deg.ravel(), geometry.dphi_deg.ravel(),
        f * (1 + 0.01 * noise), 0.01 * f,
    )  # fmt: skip


@settings(max_examples=10)
@given(
    largest_deg=st.floats(10, 80), theta_i=st.floats(0, 70), plane=st.sampled_from([0.0, 90.0]),
    seed=st.integers(0, 999),
)  # fmt: skip
def test_the_condition_predicts_what_a_fit_determines(
    largest_deg: float, theta_i: float, plane: float, seed: int
) -> None:
    """1 % points: four times below LIMIT both parameters have a u, four times above one has none.

    At four times LIMIT the worst combination is uncertain by a whole domain.
    """
    geometry = sweep([theta_i], largest_deg, plane)
    found = condition("oren_nayar", geometry, VALUES)
    result = fit(MODELS["oren_nayar"], noisy(geometry, seed))
    if found < LIMIT / 4:
        assert not result.undetermined
    if found > 4 * LIMIT:
        assert None in result.u.values()


def test_the_condition_of_known_sweeps() -> None:
    """At normal incidence (33) is constant: sigma acts like an albedo. Obliquely it does not."""
    assert condition("oren_nayar", sweep([0.0], 60, 0.0), VALUES) > 20 * LIMIT
    assert condition("oren_nayar", sweep([45.0], 60, 0.0), VALUES) < LIMIT / 4
    one = Geometry.from_degrees(theta_i=[30.0], theta_r=[10.0])
    assert condition("oren_nayar", one, VALUES) == np.inf
    plane = {"albedo": 0.8, "sigma_deg": 0.0}  # no first-order change with sigma there
    assert condition("oren_nayar", sweep([45.0], 60, 0.0), plane) == np.inf
    sigmas, ends = np.array([5.0, 30.0]), np.array([10.0, 40.0, 70.0])
    found = condition_map("oren_nayar", {"albedo": 0.8}, [30.0], 0.0, sigmas, ends)
    assert found.shape == (2, 3)
    assert np.all(np.diff(found, axis=1) < 0)  # the wider the sweep, the better
