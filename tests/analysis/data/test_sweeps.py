"""Sweeps of a scan: points grouped by incidence and plane."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.measurements import Measurements
from analysis.data.sweeps import plane_and_view, signed_view, sweeps
from instrument.geometry import Geometry
from tests.support.analysis.seeded_scan import three_sweeps
from tests.support.timing.cpu_time import cpu_ratio


def test_sweeps_are_by_incidence_and_plane_with_rising_view() -> None:
    m = three_sweeps(np.random.default_rng(1).uniform(size=96))
    found = sweeps(m)
    assert [(s.theta_i_deg, s.dphi_deg, s.points.size) for s in found] == [
        (30, 0, 32),
        (45, 0, 32),
        (60, 0, 32),
    ]
    for sweep in found:
        assert np.all(np.diff(m.theta_r_deg[sweep.points]) > 0)
        assert np.all(m.theta_i_deg[sweep.points] == sweep.theta_i_deg)


@pytest.mark.parametrize("plane", [0.0, 40.0, 179.0])
@pytest.mark.parametrize("off", [0.0, 1e-4, -1e-4, 1e-12, -1e-12])
def test_both_forms_of_a_geometry_are_one_sweep(plane: float, off: float) -> None:
    """Also with rounding errors of the azimuth: 179.9999 degrees is in the plane of 0."""
    view = np.array([-60.0, -30.0, 0.0, 20.0, 50.0])
    signed = Measurements.bare(45.0, view, plane, 0.2)
    behind = np.where(view < 0, plane + 180 + off, plane)
    unsigned = Measurements.bare(45.0, np.abs(view), np.mod(behind, 360), 0.2)
    far = Measurements.bare(45.0, -view, plane - 180 + off, 0.2)
    for m in (signed, unsigned, far):
        (sweep,) = sweeps(m)
        assert (sweep.dphi_deg, sweep.points.tolist()) == (plane, [0, 1, 2, 3, 4])
        assert signed_view(m).tolist() == view.tolist()


@given(
    theta_r=st.floats(-90.0, 90.0),
    dphi=st.integers(-720_000, 720_000).map(lambda n: n / 1000),
)
def test_plane_and_view_are_the_same_direction(theta_r: float, dphi: float) -> None:
    m = Measurements.bare(30.0, [theta_r], dphi, 0.2)
    plane, view = plane_and_view(m)
    assert 0 <= plane[0] < 180
    here = Geometry.from_degrees(theta_i=30.0, theta_r=view, dphi=plane)
    assert here.theta_r_deg == pytest.approx(m.geometry.theta_r_deg)
    if abs(theta_r) > 1e-6:
        turn = np.radians(here.dphi_deg - m.geometry.dphi_deg)
        assert np.cos(turn) == pytest.approx(1, abs=1e-10)


def test_the_cost_of_sweeps_rises_as_the_number_of_points() -> None:
    """Every point is its own sweep but for chance: a search of all points for each would square."""

    def of_scattered(n: int) -> Callable[[], object]:
        """Search in new measurements at each call: of the same ones the sweeps are remembered."""
        rng = np.random.default_rng(n)
        angles = rng.uniform(0, 75, n), rng.uniform(-80, 80, n)
        return lambda: sweeps(Measurements.bare(*angles, 0.0, np.ones(n)))

    # About 18 to 24; 64 with a search of all points for each sweep.
    assert cpu_ratio(of_scattered(128_000), of_scattered(8_000), 3) < 40
