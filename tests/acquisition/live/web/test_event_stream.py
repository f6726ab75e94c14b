"""Events as browsers get them: the same for all, whenever they come, and however they read."""

from __future__ import annotations

from tests.support.live.page_client import Browser

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
