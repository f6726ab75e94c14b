"""The report in a browser: values beside the pointer, and charts drawn for the width."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from analysis.report.page import write_report
from tests.support.analysis.report_data import data_of
from tests.support.live.chromium import Windows, chromium, missing

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = [
    pytest.mark.charts,
    pytest.mark.skipif(bool(missing()), reason=missing()),
]


@pytest.fixture(scope="module")
def windows(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Windows, str]]:
    path: Path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(path, data_of((30.0, 60.0)))
    with chromium() as browser:
        yield Windows(browser), path.as_uri()


def point_at(page: Page, mark: int) -> None:
    """Move the pointer to a mark of the chart of single sweeps."""
    circle = page.locator('.broad svg[aria-label="BRDF (1/sr)"] .marks circle').nth(mark)
    circle.scroll_into_view_if_needed()
    box = circle.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def test_the_values_of_a_point_stand_beside_the_pointer(windows: tuple[Windows, str]) -> None:
    """The policy of the page allows its script, and the browser complains of nothing."""
    from playwright.sync_api import expect

    opened, address = windows
    page = opened.open(address)
    box = page.locator("output")
    expect(box).to_be_hidden()
    for mark, angle in ((0, "θᵣ −60°"), (2, "θᵣ −30°")):
        point_at(page, mark)
        expect(box).to_be_visible()
        expect(box).to_contain_text(angle)
    page.mouse.move(2, 2)
    expect(box).to_be_hidden()
    assert opened.complaints == []


@pytest.mark.parametrize(("width", "shown", "hidden"), [(1000, "broad", "narrow"),
                                                        (400, "narrow", "broad")])  # fmt: skip
def test_charts_are_drawn_for_the_width(
    windows: tuple[Windows, str], width: int, shown: str, hidden: str
) -> None:
    """Letters are of reading size, and nothing has to be moved sideways."""
    opened, address = windows
    page = opened.open(address, width)
    for chart in page.locator(f".chart.{shown}").all():
        assert chart.is_visible()
        letters = chart.locator("text").first.bounding_box()
        assert letters is not None
        assert letters["height"] >= 9
    assert not any(chart.is_visible() for chart in page.locator(f".chart.{hidden}").all())
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_without_scripts_the_report_is_whole(windows: tuple[Windows, str]) -> None:
    opened, address = windows
    page = opened.open(address)
    with_script = page.locator("body").inner_text()
    context = opened._browser.new_context(java_script_enabled=False)
    plain = context.new_page()
    plain.goto(address)
    assert plain.locator("body").inner_text() == with_script
    context.close()
