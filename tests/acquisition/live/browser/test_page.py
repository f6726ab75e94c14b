"""The live page in a browser: what it shows of messages, and how it is used."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from urllib.parse import urlsplit

import pytest

from tests.support.live.chromium import Windows, missing
from tests.support.live.message_page import MessagePage, message_page
from tests.support.live.messages import (
    AIMING,
    POINTS,
    RUN,
    aim,
    model,
    point,
    progress,
)

if TYPE_CHECKING:
    from playwright.sync_api import Page

if missing():
    pytest.skip(missing(), allow_module_level=True)
else:
    from playwright.sync_api import expect

SHOWN = ("state", "done", "attention", "legend", "model", "chart-note", "events-list")


def tell_scan(page: MessagePage, points: int, *actions: str, state: str = "measuring") -> None:
    """Send the messages of a scan that has measured so many points."""
    page.tell("run", RUN)
    for step in range(points):
        page.tell("point", point(step))
    page.tell("happened", {"number": 1, "time_utc": "2026-11-28T04:00:00Z", "kind": "drift",
                           "text": "drift check as expected"})  # fmt: skip
    page.tell("model", model(points))
    page.tell("progress", progress(points, state, *actions))


def chart_picture(page: Page) -> str:
    """Picture of the chart as it is drawn now."""
    return str(page.evaluate("document.querySelector('#chart canvas').toDataURL()"))


def text_of(page: Page, *parts: str) -> list[str]:
    return [page.locator(f"#{part}").inner_text() for part in parts]


def test_the_curves_grow_and_a_reload_shows_them_whole(
    windows: Windows, served: MessagePage
) -> None:
    tell_scan(served, 5)
    page = windows.open(served.address)
    note = page.locator("#chart-note")
    expect(note).to_contain_text(f"5 of {POINTS} points measured, none flagged")
    expect(page.locator("#attention")).to_be_hidden()
    before = chart_picture(page)
    served.tell("point", point(5))
    expect(note).to_contain_text(f"6 of {POINTS} points")
    assert chart_picture(page) != before
    tell_scan(served, POINTS)
    expect(note).to_contain_text(f"{POINTS} of {POINTS} points measured, 1 flagged")
    drawn, shown = chart_picture(page), text_of(page, *SHOWN)
    page.reload()
    expect(note).to_contain_text(f"{POINTS} of {POINTS} points measured, 1 flagged")
    expect(page.locator("#state-text")).to_have_text("Said by the scan: measuring")
    assert (chart_picture(page), text_of(page, *SHOWN)) == (drawn, shown)


def test_two_browsers_agree(windows: Windows, served: MessagePage) -> None:
    """One from the start, and one that comes later."""
    tell_scan(served, 3)
    early = windows.open(served.address)
    expect(early.locator("#chart-note")).to_contain_text("3 of")
    tell_scan(served, 20)
    late = windows.open(served.address)
    served.tell("progress", progress(20, "paused", "resume", "abort"))
    for page in (early, late):
        expect(page.locator("#chart-note")).to_contain_text("20 of")
        expect(page.locator("#state-name")).to_have_text("Paused")
    assert text_of(early, *SHOWN) == text_of(late, *SHOWN)
    assert chart_picture(early) == chart_picture(late)


def test_the_saturated_point_is_named_in_words(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, POINTS)
    page = windows.open(served.address)
    entry = page.locator("#attention-list li")
    expect(entry).to_have_count(1)
    expect(entry).to_contain_text("θᵢ 60°, θᵣ −40° saturated: 143 pixels of 4 frames at full scale")
    entry.get_by_role("button").click()
    expect(page.locator("#selected-title")).to_have_text("Selected: θᵢ 60°, θᵣ −40°")
    expect(page.locator("#selected-flags")).to_contain_text("Not fitted. The true value is higher")
    expect(page.locator("#attention-advice")).to_contain_text("dim the lamp")
    kept = page.locator("#selected-caption")
    expect(kept).to_have_text("No frame of this reading was kept.")
    facts = page.locator("#selected-facts")
    expect(facts).to_contain_text("4095 of 4095 DN (100 %)")
    expect(facts).to_contain_text("12.3 ms, 4 frames")


def test_arrow_keys_go_along_the_points(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, POINTS)
    page = windows.open(served.address)
    expect(page.locator("#chart-note")).to_contain_text(f"{POINTS} of")
    title = page.locator("#selected-title")
    page.keyboard.press("ArrowLeft")
    expect(title).to_have_text("Selected: θᵢ 60°, θᵣ 50°")  # the newest
    page.keyboard.press("ArrowLeft")
    expect(title).to_have_text("Selected: θᵢ 60°, θᵣ 40°")
    page.locator("#chart").focus()
    page.keyboard.press("ArrowUp")
    expect(title).to_have_text("Selected: θᵢ 30°, θᵣ 40°")
    page.keyboard.press("Escape")
    expect(page.locator("#selected")).to_be_hidden()


def test_a_click_selects_the_point_under_it(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, 12)
    page = windows.open(served.address)
    expect(page.locator("#chart-note")).to_contain_text("12 of")
    box = page.locator("#chart .u-over").bounding_box()
    assert box
    # The axis reaches 3 % beyond both ends of the sweep from -60 to 50 degrees.
    share = (0.0 + 60.0 + 3.3) / (110.0 + 6.6)
    page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
    expect(page.locator("#selected-title")).to_have_text("Selected: θᵢ 30°, θᵣ 0°")


def test_the_scan_says_which_buttons_there_are(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, 5, "pause", "abort")
    page = windows.open(served.address)
    shown = page.locator("#buttons button:visible")
    expect(shown).to_have_text([re.compile("Pause"), re.compile("Abort")])
    served.tell("progress", progress(5, "paused", "resume", "abort"))
    expect(shown).to_have_text([re.compile("Resume"), re.compile("Abort")])
    served.tell("progress", progress(5, "stopped"))
    expect(shown).to_have_count(0)
    expect(page.locator("#state-name")).to_have_text("Stopped")


def test_abort_asks_once_and_a_refusal_is_shown(windows: Windows, served: MessagePage) -> None:
    """No scan listens here: the server says so."""
    tell_scan(served, 5, "pause", "abort")
    page = windows.open(served.address)
    asked = []
    page.on("request", lambda request: asked.append(request.method))
    dialog = page.locator("#abort-dialog")
    page.locator("#abort").click()
    expect(dialog).to_contain_text("5 readings are kept; gonio resume runs/demo goes on from there")
    page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()
    assert "POST" not in asked
    page.locator("#abort").click()
    page.locator("#abort-yes").click()
    expect(page.locator("#answer")).to_contain_text("no scan answers")
    assert asked.count("POST") == 1
    windows.complaints = [c for c in windows.complaints if "409" not in c]


def test_picture_and_window_are_shown_together(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, 5)
    page = windows.open(served.address)
    for number in (1, 2):
        served.tell_picture(number)
        expect(page.locator("#caption")).to_have_text(f"picture {number}")
    assert page.evaluate("document.getElementById('picture').naturalWidth") == 40
    outline = page.locator("#outline .outline-line")
    expect(outline).to_have_attribute("points", "10.5,5.5 29.5,5.5 29.5,24.5 10.5,24.5")
    expect(page.locator("#saturation")).to_have_text("7 pixels, 2 of them in the window")
    expect(page.locator("#levels")).to_contain_text("3711 of 4095 DN (91 %)")


def test_aiming_shows_sharpness_against_its_best(windows: Windows, served: MessagePage) -> None:
    served.tell("run", AIMING)
    served.tell("progress", progress(0, "aiming") | {"total": 0})
    served.tell("aim", aim(0.5, 0.5))
    page = windows.open(served.address)
    sharpness = page.locator("#aim")
    expect(sharpness).to_contain_text("100 % of the best")
    served.tell("aim", aim(0.4, 0.5, saturated=12))
    expect(sharpness).to_contain_text("80 % of the best")
    expect(page.locator("#saturation")).to_have_text("12 pixels, 6 of them in the window")
    expect(page.locator("#curves")).to_be_hidden()


def test_a_lost_connection_is_told_and_found_again(windows: Windows, tmp_path: Path) -> None:
    with message_page(tmp_path) as served:
        tell_scan(served, 5, "pause", "abort")
        page = windows.open(served.address)
        expect(page.locator("#pause")).to_be_enabled()
    banner = page.locator("#connection")
    expect(banner).to_contain_text("Connection lost, trying again")
    expect(page.locator("#pause")).to_be_disabled()
    with message_page(tmp_path, urlsplit(served.address).port or 0) as served:
        tell_scan(served, 7, "pause", "abort")
        expect(banner).to_be_hidden()
        expect(page.locator("#chart-note")).to_contain_text("7 of")
        page.close()
    windows.complaints = [c for c in windows.complaints if "ERR_" not in c]


def test_a_phone_needs_no_sideways_scrolling(windows: Windows, served: MessagePage) -> None:
    tell_scan(served, POINTS, "pause", "abort")
    served.tell_picture(1)
    page = windows.open(served.address, width=400)
    expect(page.locator("#caption")).to_have_text("picture 1")
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#selected")).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") == 400


def test_colours_follow_the_computer_until_they_are_chosen(
    windows: Windows, served: MessagePage
) -> None:
    tell_scan(served, 5)
    page = windows.open(served.address)
    schemes: tuple[Literal["dark", "light"], ...] = ("dark", "light")
    for scheme in schemes:
        page.emulate_media(color_scheme=scheme)
        expect(page.locator("html")).to_have_attribute("data-theme", scheme)
    page.locator("#theme").select_option("red")
    expect(page.locator("html")).to_have_attribute("data-theme", "red")
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", "red")
