"""White tile as a standard: a table, one number, and the u of a number away from its geometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.measure.white_tile import Standard, standard
from instrument.calibration.tile_table import TileTable
from instrument.config.protocol import WhiteTile
from instrument.geometry import FloatArray
from tests.support.white_tiles import SPECTRALON, table_text, tabled

LAMPS = np.array([0.0, 8.0, 30.0, 30.0, 45.0, 60.0, 75.0])
ALIKE = np.zeros(LAMPS.size)
# Radiance factor of sintered PTFE along the normal, relative to 8 deg/hemispherical: Germer 2017.
PTFE = {0: 1.073, 15: 1.065, 30: 1.044, 45: 1.016, 60: 0.975, 70: 0.926, 75: 0.890}


def number(certificate: str | None, theta_r_deg: float = 10.0) -> WhiteTile:
    keys = {"certificate": certificate, "theta_r_deg": theta_r_deg}
    return WhiteTile(reflectance=0.98, u_reflectance=0.004, **keys)


def covariance(found: Standard) -> FloatArray:
    """Relative covariance (N, N) that the errors state."""
    return sum(np.outer(u, u) * (g[:, None] == g) for u, g in found.errors)


def u(found: Standard) -> FloatArray:
    return np.sqrt(np.diag(covariance(found)))


@pytest.mark.parametrize("certificate", [None, "lambertian"])
def test_a_number_that_holds_everywhere_has_the_u_of_its_certificate(
    certificate: str | None,
) -> None:
    found = standard(number(certificate), LAMPS, ALIKE)
    assert np.all(found.beta == 0.98)
    assert len(found.errors) == 1
    np.testing.assert_array_equal(u(found), 0.004 / 0.98)


def test_away_from_the_certificate_the_u_grows_to_what_ptfe_departs_by() -> None:
    hemispherical = standard(number("8/hemispherical", 0.0), np.array([*map(float, PTFE)]), ALIKE)
    departs = np.abs(np.array([*PTFE.values()]) - 1)
    assert np.all(departs <= 1.2 * hemispherical.departure)
    assert np.all(hemispherical.departure <= 0.11)
    assert np.all(hemispherical.departure >= 0.03)


@pytest.mark.parametrize(("certificate", "theta_i", "theta_r"), [("0/45", 0.0, 45.0),
                                                                ("45/0", 45.0, 0.0)])  # fmt: skip
def test_a_number_of_one_direction_is_exact_there_and_loses_with_each_degree(
    certificate: str, theta_i: float, theta_r: float
) -> None:
    for sign in (1.0, -1.0):
        tile = number(certificate, sign * theta_r)
        lamps = theta_i + np.array([0.0, 3.0, 8.0, 15.0, 40.0])
        found = standard(tile, lamps, np.zeros(5))
        assert found.departure[0] == 0
        assert np.all(np.diff(found.departure) >= 0)
        assert 0.02 < found.departure[3] <= 0.05
        assert u(found)[0] == pytest.approx(0.004 / 0.98)
    # The published ratio of the radiance factors at 60/0 and 45/0, and at 30/0 and 45/0.
    apart = standard(number("45/0", 0.0), np.array([30.0, 60.0]), np.zeros(2)).departure
    assert np.all(np.abs([PTFE[30] / PTFE[45] - 1, PTFE[60] / PTFE[45] - 1]) <= 1.05 * apart)


def test_half_of_the_departure_is_common_and_one_geometry_has_one_error() -> None:
    found = standard(number("8/hemispherical"), LAMPS, ALIKE)
    own = covariance(found) - (0.004 / 0.98) ** 2
    np.testing.assert_allclose(np.diag(own), found.departure**2)
    assert own[2, 3] == pytest.approx(own[2, 2])  # both at 30 deg
    assert own[2, 5] == pytest.approx(0.5 * found.departure[2] * found.departure[5])


@settings(max_examples=30)
@given(st.floats(0.3, 1.2), st.floats(0, 0.1), st.integers(0, 999))
def test_a_constant_table_is_one_number_exactly(beta: float, u_beta: float, seed: int) -> None:
    random = np.random.default_rng(seed)
    axes = (np.array([0.0, 20.0, 80.0]), np.array([-5.0, 15.0]), np.array([0.0, 180.0]))
    shape = (3, 2, 2)
    values = TileTable(axes, np.full(shape, beta), np.zeros(shape), np.full(shape, u_beta))
    tile = WhiteTile(table="t.csv", theta_r_deg=10.0).with_values(values)
    one = number(None).model_copy(update={"reflectance": beta, "u_reflectance": u_beta})
    lamps, dphi = random.uniform(0, 80, 5), random.uniform(0, 180, 5)
    first, second = standard(tile, lamps, dphi), standard(one, lamps, dphi)
    assert first.beta.tolist() == second.beta.tolist()
    np.testing.assert_array_equal(covariance(first), covariance(second))


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1))
def test_the_errors_of_a_table_are_the_effect_of_changing_each_of_its_values(seed: int) -> None:
    """By its u; geometries share the errors of the values that they are interpolated from."""
    random = np.random.default_rng(seed)
    axes = (np.array([0.0, 30.0, 60.0, 80.0]), np.array([-20.0, 20.0]), np.linspace(0, 180, 3))
    beta, u_beta = random.uniform(0.8, 1.1, (4, 2, 3)), random.uniform(0, 0.01, (4, 2, 3))
    lamps, dphi = random.uniform(0, 80, 6), random.choice([0.0, 50.0, 180.0], 6)
    lamps[1] = lamps[0]

    def of(values: FloatArray) -> Standard:
        table = TileTable(axes, values, u_beta, np.zeros_like(u_beta))
        return standard(WhiteTile(table="t", theta_r_deg=10.0).with_values(table), lamps, dphi)

    found, expected = of(beta), np.zeros((6, 6))
    for number in range(beta.size):
        moved = beta.copy()
        moved.ravel()[number] += u_beta.ravel()[number]
        change = of(moved).beta / found.beta - 1
        expected += np.outer(change, change)
    between = found.errors[-1]
    stated = covariance(found) - np.outer(between[0], between[0]) * (
        between[1][:, None] == between[1]
    )
    np.testing.assert_allclose(stated, expected, rtol=1e-9, atol=1e-15)


def test_a_table_is_read_at_the_angles_of_the_lamp_and_the_view_of_the_tile(tmp_path: Path) -> None:
    tile = tabled(table_text(SPECTRALON, 0.002, 0.003), tmp_path)
    found = standard(tile, np.array([0.0, 60.0, 60.0]), np.array([0.0, 0.0, 180.0]))
    assert found.beta[0] == pytest.approx(1.057 * (1 - 0.18 * (1 - np.cos(np.radians(10)))))
    assert found.beta[2] > 1.01 * found.beta[1]  # forward grazing
    np.testing.assert_allclose(u(found), np.hypot(0.002, 0.003) / found.beta)
    assert found.errors[0][0] == pytest.approx(0.003 / found.beta)
