"""Repetition of tests in real time during which the machine stood still.

Emulated controllers answer within the real ones' times, and drivers have the real time-outs. Where
the test process gets no processor for longer than that, both miss theirs, and a failure says
nothing about the program. A thread measures such standstills; a test in real time that failed in
one is repeated, and the summary of the test run says so. A failure without a standstill counts.
"""

from __future__ import annotations

import threading
import time
from types import TracebackType

import pytest
from _pytest.runner import runtestprotocol

MARKS = ("waits", "real_time")
TRIES = 4
STANDSTILL_S = 0.05  # a third of the shortest time-out of a reply
_TICK_S = 0.01
_PROPERTY = "repeated"


class Standstills:
    """Longest delay of a thread that wakes every 10 ms, within a `with` block."""

    def __init__(self) -> None:
        self.longest_s = 0.0
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._measure, daemon=True, name="standstills")

    def __enter__(self) -> Standstills:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._done.set()
        self._thread.join()

    def _measure(self) -> None:
        woken_s = time.monotonic()
        while not self._done.wait(_TICK_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - woken_s - _TICK_S)
            woken_s = now_s


def is_repeated(item: pytest.Item) -> bool:
    """Return True for a test in real time on emulated devices; a real one moves but once."""
    return any(map(item.get_closest_marker, MARKS)) and not item.get_closest_marker("hil")


def run_in_real_time(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Run a test, and again if it failed while the machine stood still; report the last time."""
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    causes: list[str] = []
    while True:
        with Standstills() as standstills:
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
        again = standstills.longest_s > STANDSTILL_S and len(causes) + 1 < TRIES
        if not again or not any(report.failed for report in reports):
            break
        causes.append(f"{standstills.longest_s:.2f} s")
    for report in reports:
        if causes and report.when == "call":
            report.user_properties.append((_PROPERTY, ", ".join(causes)))
        item.ihook.pytest_runtest_logreport(report=report)
    item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)


def repetitions(reports: list[pytest.TestReport]) -> list[str]:
    """Return a line for each test that was repeated, with the standstills."""
    return [
        f"{report.nodeid}: repeated, as the machine stood still for {cause}"
        for report in reports
        for name, cause in report.user_properties
        if name == _PROPERTY
    ]
