"""Events as browsers get them: the same for all, whenever they come, and however they read."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from acquisition.live.address import address, listening_socket, port_of
from acquisition.live.following.board import Board
from acquisition.live.web.app import Shown, live_app
from acquisition.live.web.server import WebServer
from instrument.record.event_kinds import FINISHED
from tests.support.live.page_client import Browser
from tests.support.live.pages import TOKEN, served
from tests.support.live.runs import begun_run, live_protocol
from tests.support.timing.deadline import wait_for
from tests.support.whole_scans.stopped_scan import scan

MODEL = "model"


def has_model(browser: Browser) -> bool:
    return browser.of(MODEL) is not None and len(browser.points()) == 16


def test_a_reload_and_a_second_browser_show_what_the_first_does(page: str) -> None:
    with Browser(page) as first, Browser(page) as second:
        first.read_until(has_model)
        second.read_until(has_model)
        with Browser(page) as again:
            again.read_until(has_model)
    assert first.shown == second.shown == again.shown
    assert first.of("progress")["state"] == "finished"
    assert not first.of("progress")["actions"]


def test_browsers_that_come_while_a_run_grows_agree(tmp_path: Path) -> None:
    loaded, run = live_protocol(tmp_path), tmp_path / "run"
    with begun_run(loaded, run) as record, served(run) as page, ExitStack() as stack:
        browsers = [stack.enter_context(Browser(page))]
        for upto in (0, 4, 9, 15):
            scan(loaded, record, upto=upto)
            browsers.append(stack.enter_context(Browser(page)))
            browsers[0].read_until(lambda one, n=upto: len(one.points()) == n + 1)
        record.add_event("2026-11-28T05:00:00+00:00", FINISHED, "16 steps")
        for browser in browsers:
            browser.read_until(is_complete)
    assert all(browser.shown == browsers[0].shown for browser in browsers)
    assert len(browsers[0].ids) > len(browsers[-1].ids)


def is_complete(browser: Browser) -> bool:
    model, progress = browser.of(MODEL), browser.of("progress")
    return bool(model and progress and model["points"] == 10 and progress["state"] == "finished")


def test_a_browser_that_comes_back_gets_what_it_has_missed(page: str) -> None:
    with Browser(page) as whole:
        whole.read_until(has_model)
    middle = whole.ids[len(whole.ids) // 2]
    with Browser(page, last_id=middle) as rest:
        rest.read_until(lambda one: one.ids[-1:] == whole.ids[-1:])
    assert rest.ids == whole.ids[whole.ids.index(middle) + 1 :]
    assert "reset" not in rest.kinds


def test_the_id_of_an_earlier_page_gives_everything_after_a_reset(page: str) -> None:
    with Browser(page, last_id="deadbeef-17") as one, Browser(page) as other:
        one.read_until(has_model)
        other.read_until(has_model)
    assert one.kinds[0] == "reset"
    assert other.shown == {key: value for key, value in one.shown.items() if key[0] != "reset"}


def test_a_browser_that_does_not_read_holds_up_neither_the_others_nor_the_end(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    board = Board()
    with ExitStack() as stack, served_board(board, tmp_path) as page:
        stalled = [stack.enter_context(Browser(page)) for _ in range(3)]
        reading = stack.enter_context(Browser(page))
        wait_for(lambda: board.readers == 4, "all browsers")
        large = "x" * 100_000
        for number in range(100):
            board.put(f"event {number}", "happened", {"number": number, "text": large})
        reading.read_until(lambda one: len(one.shown) == 100)
        for number in range(100):  # newer content takes the place of what was not read
            board.put(f"event {number}", "happened", {"number": number, "text": "short"})
        for browser in (reading, *stalled):
            browser.read_until(lambda one: one.ids[-1:] == [f"{board.boot}-200"])
            assert [data["text"] for data in browser.shown.values()] == ["short"] * 100
        assert all(len(one.ids) < 200 for one in stalled)
        for number in range(100):
            board.put(f"event {number}", "happened", {"number": number, "text": large})
        assert board.readers == 4
    assert board.readers == 0
    assert [record.message for record in caplog.records if record.levelname != "INFO"] == []


def test_a_browser_that_went_away_is_noticed(tmp_path: Path) -> None:
    board = Board()
    with served_board(board, tmp_path) as page:
        with Browser(page):
            wait_for(lambda: board.readers == 1, "the browser")
        wait_for(lambda: board.readers == 0, "its end")


@contextmanager
def served_board(board: Board, channel: Path) -> Iterator[str]:
    """Server of a board alone; the page's address."""
    with listening_socket(0) as listener:
        app = live_app(Shown(board, channel, None), TOKEN, port_of(listener))
        with WebServer(app, listener), closing(board):
            yield address(listener, TOKEN)
