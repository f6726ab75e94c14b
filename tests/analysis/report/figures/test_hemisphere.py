"""Map of the hemisphere: where there are azimuths, and each point at its direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.report.figures.hemisphere import MOST, hemisphere_drawing, hemisphere_maps
from analysis.report.page import report_html
from analysis.report.style import svg_file
from tests.support.analysis.report_data import data_of, words

VIEWS = tuple(np.arange(-60.0, 61.0, 20.0))


def test_a_scan_in_the_plane_of_incidence_has_none() -> None:
    assert hemisphere_maps(data_of((0.0, 30.0), (0.0,), VIEWS)) == ()
    assert hemisphere_maps(data_of((30.0,), (180.0,), VIEWS)) == ()
    assert 'id="hemisphere"' not in report_html(data_of((30.0,), (0.0,), VIEWS))


def test_a_point_is_at_the_projection_of_its_direction() -> None:
    """x to the lamp's side: the same direction in its two forms has one place (DESIGN: signs)."""
    data = data_of((30.0,), (0.0, 40.0, 90.0, 140.0), VIEWS)
    (one,) = hemisphere_maps(data)
    theta, dphi = np.radians(data.theta_r_deg), np.radians(data.dphi_deg)
    back = theta < 0
    theta, dphi = np.abs(theta), np.where(back, dphi + np.pi, dphi)
    assert one.x[np.argsort(one.numbers)] == pytest.approx(np.sin(theta) * np.cos(dphi))
    assert one.y[np.argsort(one.numbers)] == pytest.approx(np.sin(theta) * np.sin(dphi))
    assert one.value == pytest.approx(data.brdf[one.numbers])


def test_incidences_in_the_plane_alone_are_left_out_and_counted() -> None:
    data = data_of((20.0, 50.0), (0.0, 90.0), VIEWS)
    kept = ~((data.theta_i_deg == 20.0) & (data.dphi_deg == 90.0))
    flags = tuple("" if keep else "occluded" for keep in kept)
    maps = hemisphere_maps(replace(data, flags=flags))
    assert [one.theta_i_deg for one in maps] == [50.0]
    page = report_html(replace(data, flags=flags))
    assert "1 of 2 incidences are shown" in words(page)


def test_many_incidences_are_thinned() -> None:
    data = data_of(tuple(np.arange(0.0, 80.0, 8.0)), (0.0, 90.0), (-40.0, 0.0, 40.0))
    maps = hemisphere_maps(data)
    assert len(maps) == MOST
    assert (maps[0].theta_i_deg, maps[-1].theta_i_deg) == (0.0, 72.0)


@pytest.mark.parametrize("values", [(0.2, 0.2), (1e-3, 5.0), (-0.01, 0.3), (0.0, 0.0)])
@pytest.mark.parametrize("narrow", [False, True])
def test_any_range_of_values_has_its_scale(values: tuple[float, float], narrow: bool) -> None:
    """Equal ones, decades, and some below zero; every point is drawn."""
    data = data_of((30.0,), (0.0, 90.0), VIEWS)
    data = replace(data, brdf=np.linspace(*values, len(data.flags)))
    maps = hemisphere_maps(data)
    svg = svg_file(hemisphere_drawing(maps, data.quantity, narrow=narrow))
    assert "BRDF (1/sr)" in svg
    assert "lamp at θᵢ = 30°" in svg
    assert sum(one.value.size for one in maps) == len(data.flags)
