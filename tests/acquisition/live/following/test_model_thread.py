"""Thread that fits: on a small share of one core, newest points first, and at once in the end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import pytest

from acquisition.live.following import model_thread
from acquisition.live.following.board import Board
from acquisition.live.following.model_thread import ModelThread
from tests.support.timing.deadline import wait_for

_WORK_S = 0.05  # of processor time of one fit


class Fits:
    """Stands for the fit: takes processor time, and keeps what it was given."""

    def __init__(self) -> None:
        self.given: list[Any] = []
        self.used_s = 0.0
        self.held = threading.Event()
        self.held.set()

    def __call__(self, reduced: Any, *_: object) -> dict[str, Any]:
        self.given.append(reduced)
        self.held.wait(30)
        begun_s = time.thread_time()
        while time.thread_time() - begun_s < _WORK_S:
            pass
        self.used_s += time.thread_time() - begun_s
        if reduced == "no fit":
            raise ZeroDivisionError("by a residual of 0")
        return {"name": reduced}


@contextmanager
def fitted(share: float = 0.2) -> Iterator[tuple[ModelThread, Fits, Board]]:
    fits, board, nothing = Fits(), Board(), SimpleNamespace()
    with (
        patch.object(model_thread, "model_content", fits),
        ModelThread(board, nothing, nothing, share) as thread,
    ):
        yield thread, fits, board


def test_the_thread_takes_its_share_of_one_core_and_no_more() -> None:
    with fitted() as (thread, fits, _):
        begun_s = time.monotonic()
        for number in range(4):
            thread.offer(number)
            wait_for(lambda n=number: fits.given[-1:] == [n], "the fit")
        # Of three whole pauses between four fits.
        assert 0.21 * (time.monotonic() - begun_s) >= 3 * _WORK_S


def test_only_the_newest_points_are_fitted_and_an_offer_never_waits() -> None:
    with fitted() as (thread, fits, board):
        fits.held.clear()
        thread.offer("first")
        wait_for(lambda: fits.given == ["first"], "the first fit")
        for number in range(1000):
            thread.offer(number)
        fits.held.set()
        thread.finish(30.0)
        assert fits.given == ["first", 999]
        assert board.after(0, 1)[-1].data == {"name": 999}


def test_the_last_points_are_fitted_without_a_pause() -> None:
    with fitted(share=1e-4) as (thread, fits, _):  # the pause would take minutes
        thread.offer("first")
        wait_for(lambda: fits.given == ["first"], "the first fit")
        thread.offer("all", last=True)
        wait_for(lambda: fits.given == ["first", "all"], "the last fit")


def test_an_end_does_not_wait_for_ever() -> None:
    with fitted() as (thread, fits, _):
        fits.held.clear()
        thread.offer("long")
        thread.finish(0.01)
        fits.held.set()


@pytest.mark.filterwarnings("error")
def test_a_fit_that_fails_says_so_and_the_next_one_is_made() -> None:
    with fitted() as (thread, fits, board):
        thread.offer("no fit")
        thread.finish(30.0)
        (message,) = board.after(0, 10**6)
        assert message.data is not None
        assert message.data["text"] == "the fit failed: by a residual of 0"
        thread.offer("better")
        thread.finish(30.0)
        assert fits.given == ["no fit", "better"]
