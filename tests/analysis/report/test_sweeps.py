"""Sweeps of a report: points on the axis that the scan sweeps, with lines and residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.models import MODELS
from analysis.report.page import report_html
from analysis.report.sweeps import group_sweeps
from analysis.report.swept_axis import AXES, AZIMUTH, LAMP, VIEW, SweptAxis
from instrument.geometry import Geometry
from tests.support.analysis.report_data import data_of, svgs, without_tile


class TestNoTile:
    def test_a_line_is_scaled_to_the_points(self) -> None:
        model = replace(data_of().candidates[1], residuals=None)
        sweep = group_sweeps(replace(without_tile(), candidates=(model,)))[0]
        line = np.interp(sweep.x_deg, sweep.line_deg, sweep.lines[0])
        np.testing.assert_allclose(line, sweep.value, rtol=1e-12)  # of the same shape


class TestSweeps:
    def test_two_forms_of_a_direction_are_one_sweep(self) -> None:
        # A negative theta_r with dphi, and a positive one with dphi + 180: geometry.py.
        signed = group_sweeps(data_of((30.0,), (0.0,), (-30.0, 0.0, 30.0)))
        data = data_of((30.0,), (0.0,), (-30.0, 0.0, 30.0))
        folded = replace(
            data, theta_r_deg=np.abs(data.theta_r_deg), dphi_deg=np.array([180.0, 0.0, 360.0])
        )
        (sweep,) = group_sweeps(folded)
        np.testing.assert_array_equal(sweep.x_deg, signed[0].x_deg)
        np.testing.assert_array_equal(sweep.value, signed[0].value)
        assert sweep.in_plane

    @pytest.mark.parametrize(
        ("dphi_deg", "plane_deg", "sign"),
        [
            (45.0, 45.0, 1),
            (90.0, 90.0, 1),
            (135.0, 315.0, -1),
            (270.0, 90.0, -1),
            (315.0, 315.0, 1),
        ],
    )
    def test_positive_is_the_lamps_side_in_every_plane(
        self, dphi_deg: float, plane_deg: float, sign: int
    ) -> None:
        (sweep,) = group_sweeps(data_of((30.0,), (dphi_deg,), (-20.0, 40.0)))
        assert sweep.shown_panel_deg == plane_deg
        np.testing.assert_array_equal(sweep.x_deg, np.sort(sign * np.array([-20.0, 40.0])))

    def test_angles_read_back_with_jitter_fall_into_their_settings(self) -> None:
        data = data_of((30.0, 60.0), (0.0, 45.0))
        jitter = np.random.default_rng(1).uniform(-0.05, 0.05, (2, len(data.flags)))
        data = replace(
            data, theta_i_deg=data.theta_i_deg + jitter[0], dphi_deg=data.dphi_deg + jitter[1]
        )
        sweeps = group_sweeps(data)
        assert [(s.panel, s.series) for s in sweeps] == [(0, 0), (0, 1), (1, 0), (1, 1)]

    def test_normal_value_is_measured_between_neighbours(self) -> None:
        data = data_of((30.0,), theta_r=(-10.0, 10.0, 30.0))
        assert group_sweeps(data)[0].unit == pytest.approx(0.25)

    def test_normal_value_comes_from_the_model_where_none_is_measured(self) -> None:
        data = data_of((30.0,), theta_r=(20.0, 40.0))
        assert group_sweeps(data)[0].unit == pytest.approx(0.25)
        bare = replace(data, candidates=())
        assert np.isnan(group_sweeps(bare)[0].unit)
        assert svgs(report_html(bare))

    def test_residuals_belong_to_the_points_of_the_fit(self) -> None:
        data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
        fitted = np.array([True, False, True])
        model = replace(data.candidates[1], residuals=np.array([1.0, -2.0]))
        (sweep,) = group_sweeps(replace(data, fitted=fitted, candidates=(model,)))
        np.testing.assert_array_equal(sweep.residual, [1.0, np.nan, -2.0])


ANGLES = st.tuples(st.floats(0, 89), st.floats(-360, 360), st.floats(-89, 89))


@given(st.lists(ANGLES, min_size=1, max_size=20), st.sampled_from(AXES))
def test_a_place_on_an_axis_is_the_same_direction(
    angles: list[tuple[float, float, float]], axis: SweptAxis
) -> None:
    """Model and points are compared at one geometry, whatever axis they are drawn against."""
    theta_i, dphi, theta_r = np.array(angles).T
    back = axis.angles(*axis.place(theta_i, dphi, theta_r))
    one = Geometry.from_degrees(theta_i=theta_i, dphi=dphi, theta_r=theta_r)
    other = Geometry.from_degrees(theta_i=back[0], dphi=back[1], theta_r=back[2])
    model = MODELS["oren_nayar"]
    np.testing.assert_allclose(
        model.brdf(one, albedo=0.8, sigma_deg=30),
        model.brdf(other, albedo=0.8, sigma_deg=30),
        rtol=1e-9,
    )


@pytest.mark.parametrize(
    ("counts", "axis"),
    [
        ((3, 1, 33), VIEW),
        ((3, 4, 33), VIEW),
        ((2, 1, 2), VIEW),
        ((1, 1, 1), VIEW),
        ((31, 1, 1), LAMP),
        ((31, 2, 3), LAMP),
        ((1, 19, 2), AZIMUTH),
        ((2, 37, 3), AZIMUTH),
    ],
)
def test_the_axis_that_the_scan_sweeps_is_drawn(
    counts: tuple[int, int, int], axis: SweptAxis
) -> None:
    """Numbers of lamp angles, azimuths (of half a turn), and view angles on both sides."""
    lamps, azimuths, views = counts
    sweeps = group_sweeps(
        data_of(
            tuple(np.linspace(20.0, 75.0, lamps)),
            tuple(np.arange(azimuths) * 180.0 / azimuths),
            tuple(np.linspace(-60.0, 55.0, views)),
        )
    )
    assert {s.axis for s in sweeps} == {axis}
    assert sum(s.x_deg.size for s in sweeps) == lamps * azimuths * views
    for sweep in sweeps:
        assert np.all(np.diff(sweep.x_deg) >= 0)


def test_deviations_are_those_of_the_points_from_the_line() -> None:
    data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
    (sweep,) = group_sweeps(replace(data, brdf=data.brdf * np.array([1.02, 1.0, 0.97])))
    np.testing.assert_allclose(sweep.deviation, [2.0, 0.0, -3.0], atol=1e-9)
    np.testing.assert_allclose(sweep.u_deviation, 1.0)


def test_radiance_under_a_moving_lamp_has_lines_with_the_cosine_of_incidence() -> None:
    """Without a tile, radiance is proportional to BRDF times cos(theta_i)."""
    data = data_of(tuple(np.arange(0.0, 76.0, 5.0)), theta_r=(45.0,))
    data = replace(data, radiance=1e5 * data.brdf * np.cos(np.radians(data.theta_i_deg)))
    model = replace(data.candidates[1], residuals=None)
    (sweep,) = group_sweeps(replace(without_tile(data), candidates=(model,)))
    np.testing.assert_allclose(sweep.deviation, 0.0, atol=1e-9)
