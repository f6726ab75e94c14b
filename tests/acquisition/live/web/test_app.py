"""Answers of the live page: actions reach the scan that answers, and none is claimed elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.live.page_client import Browser, ask, post, with_token
from tests.support.live.pages import TOKEN, served
from tests.support.live.runs import begun_run, live_protocol
from tests.support.live.scan_side import scan_side


def test_the_page_and_what_it_needs_are_served_as_what_they_are(page: str) -> None:
    answer = ask(page, with_token(page, "/"))
    assert (answer.status, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
    kinds = {
        "scripts/main.js": "javascript", "styles/theme.css": "text/css",
        "icon.svg": "image/svg+xml", "uplot/uPlot.min.css": "text/css",
    }  # fmt: skip
    for path, kind in kinds.items():
        answer = ask(page, f"/static/{path}")
        assert answer.status == 200
        assert kind in answer.headers["content-type"]


@pytest.mark.parametrize("action", ["pause", "resume", "abort"])
def test_a_run_that_has_ended_takes_no_action(page: str, action: str) -> None:
    answer = post(page, action)
    assert answer.status == 409
    assert answer.text.startswith("no scan answers")


@pytest.mark.parametrize("action", ["watch", "reboot", "..", "pause%0Aabort"])
def test_there_are_three_actions(page: str, action: str) -> None:
    assert post(page, action).status == 404


def test_actions_reach_the_scan_and_its_refusal_the_browser(
    tmp_path: Path, own_folder: Path
) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run), scan_side(run, loaded) as side, served(run) as page:
        for action in ("pause", "resume", "abort"):
            assert post(page, action).status == 204
        assert side.commands == ["pause", "resume", "abort"]
        side.refuses = "the scan is ending"
        answer = post(page, "abort")
        assert (answer.status, answer.text) == (409, "the scan is ending\n")
        asked = len(side.commands)
        assert ask(page, "/actions/abort", "POST", {"X-Gonio-Token": f"{TOKEN}x"}).status == 403
        assert ask(page, with_token(page, "/actions/abort")).status == 405
        assert len(side.commands) == asked


def test_the_newest_picture_is_there_until_it_is_superseded(
    tmp_path: Path, own_folder: Path
) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with (
        begun_run(loaded, run), scan_side(run, loaded) as side, served(run) as page,
        Browser(page) as browser,
    ):  # fmt: skip
        side.show(1000)
        browser.read_until(lambda one: one.of("picture") is not None)
        first = browser.of("picture")["number"]
        answer = ask(page, with_token(page, f"/pictures/{first}.jpg"))
        assert (answer.status, answer.headers["content-type"]) == (200, "image/jpeg")
        assert answer.body.startswith(b"\xff\xd8")
        side.show(2000)
        browser.read_until(lambda one: one.of("picture")["number"] > first)
        assert ask(page, with_token(page, f"/pictures/{first}.jpg")).status == 404
