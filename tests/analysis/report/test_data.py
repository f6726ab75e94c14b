"""Report data: grouping into sweeps, and checks of lengths."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.report.data import group_sweeps
from analysis.report.page import report_html
from tests.support.analysis.report_data import data_of, svgs, without_tile


class TestNoTile:
    def test_a_line_is_scaled_to_the_points(self) -> None:
        model = replace(data_of().candidates[1], residuals=None)
        sweep = group_sweeps(replace(without_tile(), candidates=(model,)))[0]
        line = np.interp(sweep.theta_r_deg, sweep.line_deg, sweep.lines[0])
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
        np.testing.assert_array_equal(sweep.theta_r_deg, signed[0].theta_r_deg)
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
        assert sweep.plane_deg == plane_deg
        np.testing.assert_array_equal(sweep.theta_r_deg, np.sort(sign * np.array([-20.0, 40.0])))

    def test_angles_read_back_with_jitter_fall_into_their_settings(self) -> None:
        data = data_of((30.0, 60.0), (0.0, 45.0))
        jitter = np.random.default_rng(1).uniform(-0.05, 0.05, (2, len(data.flags)))
        data = replace(
            data, theta_i_deg=data.theta_i_deg + jitter[0], dphi_deg=data.dphi_deg + jitter[1]
        )
        sweeps = group_sweeps(data)
        assert [(s.plane, s.incidence) for s in sweeps] == [(0, 0), (0, 1), (1, 0), (1, 1)]

    def test_normal_value_is_measured_between_neighbours(self) -> None:
        data = data_of((30.0,), theta_r=(-10.0, 10.0, 30.0))
        assert group_sweeps(data)[0].at_normal == pytest.approx(0.25)

    def test_normal_value_comes_from_the_model_where_none_is_measured(self) -> None:
        data = data_of((30.0,), theta_r=(20.0, 40.0))
        assert group_sweeps(data)[0].at_normal == pytest.approx(0.25)
        bare = replace(data, candidates=())
        assert np.isnan(group_sweeps(bare)[0].at_normal)
        assert svgs(report_html(bare))

    def test_residuals_belong_to_the_points_of_the_fit(self) -> None:
        data = data_of((30.0,), theta_r=(-30.0, 0.0, 30.0))
        fitted = np.array([True, False, True])
        model = replace(data.candidates[1], residuals=np.array([1.0, -2.0]))
        (sweep,) = group_sweeps(replace(data, fitted=fitted, candidates=(model,)))
        np.testing.assert_array_equal(sweep.residual, [1.0, np.nan, -2.0])


@pytest.mark.parametrize("column", ["brdf", "flags", "fitted", "theta_r_deg"])
def test_columns_of_unlike_lengths_are_refused(column: str) -> None:
    data = data_of()
    with pytest.raises(ValueError, match=r"entries for \d+ points"):
        replace(data, **{column: getattr(data, column)[1:]})


def test_residuals_of_another_fit_are_refused() -> None:
    data = data_of()
    with pytest.raises(ValueError, match="17 residuals for 18 points"):
        replace(data, candidates=(replace(data.candidates[1], residuals=np.zeros(17)),))
