"""Figures as files: every chart as SVG, and tables that hold what the charts show."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from analysis.report.figure_data import figure_files
from tests.support.analysis.report_data import data_of, without_tile


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def column(text: str, name: str) -> list[float]:
    return [float(row[name] or "nan") for row in rows(text)]


def test_every_chart_is_a_file_of_svg_on_white() -> None:
    files = figure_files(data_of((30.0, 60.0), (0.0, 45.0, 90.0)))
    drawn = {name for name in files if name.endswith(".svg")}
    assert drawn == {"shape-1.svg", "shape-2.svg", "brdf.svg", "polar.svg", "hemisphere.svg"}
    for name in drawn:
        root = ElementTree.fromstring(files[name])
        assert root.get("width", "").endswith("pt")
        assert "fill: #ffffff" in files[name]


@pytest.mark.parametrize("tile", [True, False])
def test_the_points_are_those_of_the_run(tile: bool) -> None:
    """Each once, whatever the order of the charts."""
    data = data_of((30.0, 60.0), (0.0, 90.0))
    data = data if tile else without_tile(data)
    text = figure_files(data)["points.csv"]
    value, u = data.value_and_u
    names = ("brdf_per_sr", "u_brdf_per_sr")
    if not tile:
        names = ("radiance_counts_per_s", "u_radiance_counts_per_s")
    table = np.column_stack([column(text, n) for n in ("theta_i_deg", "dphi_deg", "theta_r_deg")])
    expected = np.column_stack([data.theta_i_deg, data.dphi_deg, data.theta_r_deg])
    order, own = np.lexsort(table.T), np.lexsort(expected.T)
    assert table[order] == pytest.approx(expected[own])
    assert np.array(column(text, names[0]))[order] == pytest.approx(value[own], rel=1e-8)
    assert np.array(column(text, names[1]))[order] == pytest.approx(u[own], rel=1e-8)


def test_the_lines_are_those_of_the_models() -> None:
    """At every place of a line; a deviation is that of the point from the first of them."""
    data = data_of((30.0, 60.0))
    files = figure_files(data)
    for candidate in data.plotted:
        own = [row for row in rows(files["lines.csv"]) if row["model"] == candidate.name]
        angles = (
            np.array([float(row[name]) for row in own])
            for name in ("theta_i_deg", "dphi_deg", "theta_r_deg")
        )
        assert candidate.curve is not None
        brdf = [float(row["brdf_per_sr"]) for row in own]
        assert brdf == pytest.approx(candidate.curve(*angles), rel=1e-8)
    line = {
        (row["theta_i_deg"], row["theta_r_deg"]): float(row["brdf_per_sr"])
        for row in rows(files["lines.csv"])
        if row["model"] == data.plotted[0].name
    }
    for row in rows(files["points.csv"]):
        there = line[row["theta_i_deg"], row["theta_r_deg"]]
        off = 100 * (float(row["brdf_per_sr"]) / there - 1)
        assert float(row["deviation_percent"]) == pytest.approx(off, abs=1e-4)


def test_the_budget_has_a_column_for_each_source() -> None:
    data = data_of()
    points = len(data.flags)
    random = np.random.default_rng(5)
    sources = {f"source {k}": random.uniform(0, 0.1, points) for k in range(3)}
    text = figure_files(replace(data, sources=sources))["budget.csv"]
    for name, part in sources.items():
        assert column(text, f"u of {name} (%)") == pytest.approx(100 * part, rel=1e-8)


def test_without_a_value_there_is_no_file() -> None:
    data = data_of()
    nothing = np.full(len(data.flags), np.nan)
    bare = replace(data, brdf=nothing, radiance=nothing, candidates=())
    assert figure_files(bare) == {}
