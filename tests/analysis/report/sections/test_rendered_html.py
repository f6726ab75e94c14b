"""Section with pictures of the material: what it shows, and that it stays within the page."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.report.data import Rendered
from analysis.report.page import report_html
from analysis.report.sections.rendered_html import rendered_html
from tests.support.analysis.report_data import data_of

_ROUND = np.array([[np.nan, 0.2], [0.4, 0.3]])
SAMPLE = Rendered(
    name="oren_nayar<b>",
    albedo=0.7,
    model=_ROUND,
    lambert=_ROUND / 2,
    shape="profile of a vase",
    places=np.array([-1.0, 0.0, 1.0]),
    heights=np.array([0.0, 0.8, 0.0]),
    lambert_heights=np.array([0.0, 0.5, 0.1]),
    model_heights=np.array([0.0, 0.8, 0.01]),
    scene="One lamp.",
    cost="Lambert costs < 3 degrees.",
)


def test_it_shows_three_spheres_and_a_profile_and_says_the_cost() -> None:
    html = rendered_html(lambda: SAMPLE)
    assert html.count("data:image/png;base64,") == 3
    assert html.count("<polyline") == 3
    assert "Lambert costs &lt; 3 degrees." in html
    assert "by up to 50 % of white" in html
    assert "<b>" not in html


def test_without_a_model_there_is_no_section() -> None:
    assert rendered_html(None) == rendered_html(lambda: None) == ""
    assert 'id="rendered"' not in report_html(data_of())


def test_pictures_that_do_not_differ_are_drawn() -> None:
    html = rendered_html(lambda: replace(SAMPLE, lambert=_ROUND))
    assert "by up to 0 % of white" in html


def test_profiles_stay_inside_their_picture() -> None:
    steep = replace(SAMPLE, lambert_heights=np.array([0.0, 40.0, 0.0]))
    html = rendered_html(lambda: steep)
    places = [float(n) for points in re.findall('points="([^"]+)"', html)
              for n in re.split("[ ,]", points)]  # fmt: skip
    assert min(places) >= 0
    assert max(places) <= 100


def test_the_section_stands_in_the_page_and_is_made_when_that_is_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("analysis.report.page.rendered_html", rendered_html)
    made = []
    data = replace(data_of(), rendered=lambda: made.append(1) or SAMPLE)
    assert not made
    assert report_html(data).count('id="rendered"') == 1
    assert made == [1]
