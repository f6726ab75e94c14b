"""Range of a value axis: all points with their bars are inside, and fill it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from analysis.report.figures.value_axis import set_symmetric_axis, set_value_axis
from analysis.report.sweeps import PlottedSweep, group_sweeps
from tests.support.analysis.report_data import data_of

MAGNITUDES = st.floats(-12, 12).map(lambda power: 10.0**power)


def _sweep(value: list[float], u: float = 0.0, flagged: int = 0) -> PlottedSweep:
    views = tuple(np.linspace(-60.0, 60.0, len(value)))
    data = data_of((30.0,), theta_r=views, candidates=())
    flags = ("outlier",) * flagged + ("",) * (len(value) - flagged)
    found = replace(data, brdf=np.array(value), u_brdf=np.full(len(value), u), flags=flags)
    return group_sweeps(found)[0]


def _limits(*sweeps: PlottedSweep, unit: float = 1.0) -> tuple[float, float]:
    ax = Figure().subplots()
    set_value_axis(ax, [(s, unit) for s in sweeps])
    low, high = ax.get_ylim()
    return float(low), float(high)


@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=9), MAGNITUDES, st.floats(0.0, 0.05))
def test_points_with_their_bars_are_inside_and_fill_the_range(
    values: list[float], scale: float, u: float
) -> None:
    value = np.array(values) * scale
    low, high = _limits(_sweep(value.tolist(), u * scale))
    ends = value.min() - u * scale, value.max() + u * scale
    assert low <= ends[0]
    assert ends[1] <= high
    if np.ptp(value) > 0.005 * value.max() and ends[1] < 40 * ends[0]:
        from_zero = ends[1] > 2 * ends[0]
        used = ends[1] - (0.0 if from_zero else ends[0])
        assert used / (high - low) > 0.8
        assert (low == 0.0) == from_zero


def test_a_variation_of_ten_per_cent_is_no_line() -> None:
    low, high = _limits(_sweep([0.95, 1.0, 1.05]))
    assert (low, high) == pytest.approx((0.942, 1.058))


def test_a_constant_is_not_enlarged_to_noise() -> None:
    low, high = _limits(_sweep([0.3, 0.3, 0.3]))
    assert 0.003 * 0.3 < high - low < 0.01 * 0.3


def test_decades_have_a_logarithmic_axis() -> None:
    ax = Figure().subplots()
    set_value_axis(ax, [(_sweep([0.01, 0.1, 5.0]), 1.0)])
    assert ax.get_yscale() == "log"


def test_a_flagged_outlier_does_not_compress_the_others() -> None:
    low, high = _limits(_sweep([50.0, 1.0, 0.95, 1.05], flagged=1))
    assert (low, high) == pytest.approx((0.95, 1.1), abs=0.06)


@given(st.lists(st.floats(-1e6, 1e6), max_size=6), st.floats(0.1, 10))
def test_an_axis_about_zero_holds_every_value(values: list[float], least: float) -> None:
    limit = set_symmetric_axis(Figure().subplots(), [np.array([*values, np.nan])], least)
    assert limit >= max([least, *np.abs(values)])
