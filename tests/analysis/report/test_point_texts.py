"""Values beside the pointer: those of the point under it."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from analysis.report.page import report_html
from analysis.report.point_texts import point_texts
from analysis.report.style import format_value
from analysis.report.sweeps import group_sweeps
from tests.support.analysis.report_data import data_of, svgs, without_tile

pytestmark = pytest.mark.charts


@pytest.mark.parametrize("tile", [True, False])
def test_each_text_has_the_direction_value_and_flag_of_its_point(tile: bool) -> None:
    data = data_of((30.0, 60.0), (0.0, 90.0))
    data = replace(data, flags=("saturated", *data.flags[1:]))
    data = data if tile else without_tile(data)
    texts = point_texts(data, group_sweeps(data))
    value, u = data.value_and_u
    for i, text in enumerate(texts):
        place, measured, *rest = text.split("\n")
        angles = [float(a.replace("−", "-")) for a in re.findall(r"([−0-9.]+)°", place)]
        assert angles == [data.theta_i_deg[i], data.theta_r_deg[i], data.dphi_deg[i]]
        assert measured.endswith(format_value(value[i], u[i], "1/sr" if tile else "counts/s"))
        assert (rest[-1:] == ["saturated"]) == (i == 0)


def test_differences_are_those_of_the_chart() -> None:
    data = data_of()
    texts = point_texts(data, group_sweeps(data))
    for sweep in group_sweeps(data):
        for n, i in enumerate(sweep.at):
            found = re.search(r"([+−])([0-9.e× -]+) % of the line", texts[i])
            assert found is not None
            assert (found[1] == "−") == (sweep.deviation[n] < 0)
            assert float(found[2]) == pytest.approx(abs(sweep.deviation[n]), rel=0.06)


def test_a_mark_stands_for_every_point_in_every_chart() -> None:
    """In both widths; the chart of the shape shows each in three panels."""
    data = data_of((30.0, 60.0))
    charts = [svg for svg in svgs(report_html(data)) if svg.find(".//*[@data-p]") is not None]
    assert len(charts) == 6
    times = {"shape": 3, "BRDF (1/sr)": 1, "BRDF (1/sr), polar": 1}
    for chart in charts:
        label = chart.get("aria-label", "").partition(" against")[0]
        counted = Counter(int(mark.get("data-p", "")) for mark in chart.findall(".//*[@data-p]"))
        assert set(counted) == set(range(len(data.flags)))
        assert set(counted.values()) <= {times[label], times[label] - 1}  # no residual: not fitted


def test_a_mark_is_at_its_point() -> None:
    """In order of the view angle from left to right, within the chart."""
    data = data_of((30.0,), theta_r=tuple(np.arange(-60.0, 61.0, 15.0)))
    chart = next(s for s in svgs(report_html(data)) if s.get("aria-label") == "BRDF (1/sr)")
    marks = chart.findall(".//*[@data-p]")
    at = sorted((float(m.get("cx", "")), int(m.get("data-p", ""))) for m in marks)
    assert [data.theta_r_deg[i] for _, i in at] == sorted(data.theta_r_deg)
    _, _, width, height = (float(part) for part in chart.get("viewBox", "").split())
    assert all(0 < x < width for x, _ in at)
    assert all(0 < float(m.get("cy", "")) < height for m in marks)
