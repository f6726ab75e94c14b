"""Charts of the report: planes and thinned sweeps."""

from __future__ import annotations

import numpy as np

from analysis.report.page import report_html
from tests.support.analysis.report_data import data_of, words


class TestSweeps:
    def test_many_sweeps_are_thinned_and_the_caption_states_it(self) -> None:
        incidences = tuple(np.arange(0.0, 70.0, 5.0))
        page = report_html(data_of(incidences, theta_r=(-30.0, 30.0)))
        assert "12 of 14 sweeps are shown" in page


def test_several_planes_are_named() -> None:
    page = report_html(data_of((30.0,), (0.0, 45.0, 90.0), (-30.0, 0.0, 30.0)))
    text = words(page)
    for plane in ("Δφ = 0° (negative θᵣ: Δφ = 180°)", "Δφ = 45° (negative θᵣ: Δφ = 225°)"):
        assert plane in text
