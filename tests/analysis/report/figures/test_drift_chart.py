"""Drift of the lamp in a report: a chart with its data, a jump without a line across it."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from analysis.report.data import LampLevels
from analysis.report.figure_data import figure_files
from analysis.report.page import report_html
from tests.support.analysis.report_data import data_of, words


def levels(rng: np.random.Generator, stretches: int = 1) -> LampLevels:
    count = 4 * stretches
    return LampLevels(
        theta_i_deg=30.0,
        theta_r_deg=10.0,
        time_s=np.sort(rng.uniform(0.0, 1e4, count)),
        level=1.0 + rng.normal(0.0, 0.01, count),
        u=rng.uniform(1e-5, 1e-3, count),
        stretch=np.repeat(np.arange(stretches), 4),
    )


@pytest.mark.parametrize("seed", range(2))
def test_the_table_holds_what_the_chart_shows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lamp = (levels(rng), levels(rng, 2))
    files = figure_files(data_of((30.0,), lamp=lamp))
    assert "change of the lamp (%)" in files["drift.svg"]
    found = list(csv.DictReader(io.StringIO(files["drift.csv"])))
    for name, column in (("time_s", "time_s"), ("level", "level"), ("u", "u_level")):
        expected = np.concatenate([getattr(one, name) for one in lamp])
        np.testing.assert_allclose([float(row[column]) for row in found], expected, rtol=1e-8)


def test_the_page_shows_it_and_names_a_jump() -> None:
    rng = np.random.default_rng(3)
    steady = words(report_html(data_of((30.0,), lamp=(levels(rng),))))
    assert "Drift of the lamp" in steady
    assert "jump" not in steady
    assert "1 jump of the lamp" in words(report_html(data_of((30.0,), lamp=(levels(rng, 2),))))
    assert "Drift of the lamp" not in words(report_html(data_of((30.0,))))


def test_calibrations_and_files_are_escaped() -> None:
    rows = (("<b>camera", "<script>"),)
    page = report_html(data_of((30.0,), calibrations=rows, files=rows))
    assert page.count("&lt;b&gt;camera") == 2
    for section in ("calibrations", "files"):
        assert page.count(f'id="{section}"') == 1
