"""Charts of the report: what is drawn of many sweeps, and against which angle."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.report.captions import counts
from analysis.report.data import ReportData
from analysis.report.figure_list import ReportFigure, chart_figures
from analysis.report.figures import charts
from analysis.report.style import svg_file
from analysis.report.sweeps import group_sweeps
from tests.support.analysis.report_data import data_of, without_tile, words

VIEWS = tuple(np.arange(-70.0, 71.0, 10.0))


def _figures(data: ReportData) -> dict[str, ReportFigure]:
    """Figures by name, none of them drawn yet."""
    return {figure.name: figure for figure in chart_figures(data, group_sweeps(data))}


def _shape(data: ReportData) -> str:
    """Text of the charts of the shape for a wide page, and of their caption."""
    figure = _figures(data)["shape"]
    return words("".join([*map(svg_file, figure.drawings(False)), figure.caption]))


def test_many_sweeps_are_thinned_and_the_captions_state_it() -> None:
    data = data_of(tuple(np.arange(0.0, 70.0, 5.0)), theta_r=VIEWS)
    shown = _shape(data)
    assert "12 of 14 sweeps are shown" in _figures(data)["brdf"].caption
    assert "12 of 14 series are shown" in shown
    assert shown.count("lamp at θᵢ =") == 12


def test_several_planes_are_named() -> None:
    shown = _shape(data_of((30.0,), (0.0, 45.0, 90.0), VIEWS))
    for plane in ("Δφ = 0° (negative θᵣ: Δφ = 180°)", "Δφ = 45° (negative θᵣ: Δφ = 225°)"):
        assert plane in shown


def test_many_planes_are_thinned() -> None:
    data = data_of((30.0,), tuple(np.arange(0.0, 180.0, 15.0)), VIEWS)
    assert "6 of 12 planes are shown" in _shape(data)
    assert "12 angles from 0° to 345°" in counts(data, group_sweeps(data))


@pytest.mark.parametrize("tile", [True, False])
def test_a_moving_lamp_is_drawn_against_its_angle(tile: bool) -> None:
    """31 lamp angles and one view are one series, not 31 entries of a legend."""
    data = data_of(tuple(np.linspace(0.0, 75.0, 31)), theta_r=(45.0,))
    data = data if tile else without_tile(data)
    shown = _shape(data)
    assert shown.count("camera at θᵣ = 45°") == 1
    assert "lamp angle θᵢ (°), on the camera’s side" in shown
    assert "camera 45°" in shown  # where lamp and camera meet
    assert "lamp at" not in shown
    assert ("lamp’s level at each of its settings as unknown" in shown) != tile
    assert "lamp angle θᵢ from 0° to 75°" in counts(data, group_sweeps(data))


def test_an_azimuth_sweep_is_drawn_against_the_azimuth() -> None:
    shown = _shape(data_of((45.0,), tuple(np.linspace(0.0, 180.0, 19)), (30.0, 60.0)))
    assert "azimuth Δφ (°) from the lamp’s side" in shown
    assert "lamp at θᵢ = 45°" in shown
    assert (shown.count("camera at θᵣ = 30°"), shown.count("camera at θᵣ = 60°")) == (1, 1)


def test_deviations_are_shown_in_per_cent_beside_residuals_in_u() -> None:
    data = data_of()
    shown = _shape(data)
    assert "deviation (%)" in shown
    assert "residual / u" in shown
    bare = _shape(replace(data, candidates=()))
    assert "deviation" not in bare
    assert "residual" not in bare


def test_every_number_of_a_legend_has_its_line() -> None:
    """Series keep colour and marker of their number where some are left out."""
    sweeps = group_sweeps(data_of(tuple(np.arange(0.0, 70.0, 5.0)), theta_r=VIEWS))
    shown = charts.thinned_series(sweeps)
    assert [s.series for s in shown][:1] == [0]
    assert [s.series for s in shown][-1:] == [13]
    for narrow in (False, True):
        (drawing,) = charts.shape_drawings(sweeps, "BRDF (1/sr)", narrow=narrow)
        labels = re.findall(r"lamp at θᵢ = ([0-9]+)°", svg_file(drawing))
        assert labels == [f"{s.series_deg:g}" for s in shown]
