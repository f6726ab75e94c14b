"""Waiting in tests: for an event, never for a time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import NoReturn

DEADLINE_S = 20.0


def wait_for(condition: Callable[[], bool], what: str, deadline_s: float = DEADLINE_S) -> None:
    """Return once the condition is true; fail at the deadline."""
    until_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < until_s, f"{what}: not within {deadline_s} s"
        time.sleep(0.001)


def send_and_await(number: int) -> NoReturn:
    """Send this process a signal and wait for its exception; fail at the deadline.

    Its handler may run in a destructor, which cannot raise: the signal is sent again later then.
    """
    os.kill(os.getpid(), number)
    wait_for(lambda: False, "the exception of the signal")
    raise AssertionError
