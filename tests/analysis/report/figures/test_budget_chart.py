"""Chart of the uncertainty budget: bands that make up the whole, for the points that have a u."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.report.data import ReportData
from analysis.report.figures.budget_chart import (
    budget_drawing,
    ranked_sources,
    stacks,
    with_budget,
)
from analysis.report.page import report_html
from analysis.report.style import svg_file
from analysis.report.sweeps import group_sweeps
from tests.support.analysis.report_data import NAN, data_of

pytestmark = pytest.mark.charts


def budgeted(sources: int) -> ReportData:
    """Points with so many sources of random size; one is unknown at the first point."""
    data, random = data_of(), np.random.default_rng(sources)
    u = random.uniform(1e-4, 1e-2, (sources, len(data.flags)))
    u[-1, 0] = NAN
    return replace(data, sources={f"source {k}": row for k, row in enumerate(u)})


@pytest.mark.parametrize("sources", [1, 6, 7, 12])
def test_the_bands_add_up_to_the_standard_uncertainty(sources: int) -> None:
    data = budgeted(sources)
    u = np.sqrt(sum(np.nan_to_num(part) ** 2 for part in data.sources.values()))
    for sweep in group_sweeps(data):
        bands = stacks(data, sweep)
        assert len(bands) == len(ranked_sources(data)) == min(sources, 7)
        assert bands.sum(axis=0) == pytest.approx(100 * u[sweep.at], rel=1e-9)
    for narrow in (False, True):
        drawing = budget_drawing(data, group_sweeps(data), narrow=narrow)
        ElementTree.fromstring(svg_file(drawing))


def test_a_sweep_of_flagged_points_has_no_panel() -> None:
    data = budgeted(3)
    first = data.theta_i_deg == data.theta_i_deg[0]
    some = replace(data, flags=tuple("saturated" if one else "" for one in first))
    assert len(with_budget(some, group_sweeps(some))) == len(group_sweeps(some)) - 1
    none = replace(data, flags=("saturated",) * len(data.flags))
    assert with_budget(none, group_sweeps(none)) == ()
    assert "uncertainty by source" not in report_html(none)
    assert "uncertainty by source" in report_html(some)
