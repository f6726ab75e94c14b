"""Waiting for an event with a deadline: tests never sleep a fixed time."""

from __future__ import annotations

import time
from collections.abc import Callable


def wait_until(condition: Callable[[], bool], deadline_s: float = 5.0) -> None:
    """Return once the condition is true; fail at the deadline."""
    end_s = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < end_s, f"did not happen within {deadline_s:g} s"
        time.sleep(0.001)
