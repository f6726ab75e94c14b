"""Repetition of tests in real time during which the machine stood still.

Emulated controllers answer within the real ones' times, and drivers have the real time-outs. Where
the test process gets no processor for longer than that, both miss theirs, and a failure says
nothing about the program. A thread measures such standstills, one long one or many short ones in a
row. It also sends bytes through a pseudo-terminal, as the drivers and the controllers do: the
kernel's thread that carries them may be kept from running while all of the test's own threads run.
The thread that measures sleeps most of the time, and so is served before one that computes: for the
other threads of the test, and for the processes that it started, the kernel's own count tells how
long they were ready to run and did not. A thread that runs on a virtual machine's processor stands
still where the host takes that processor away; the thread that measures may run on another, and the
kernel counts this time apart.
A test in real time that failed in a standstill is repeated, and the summary of the test run says
so. A failure without one counts.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from contextlib import suppress
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

from instrument.closeable import Closeable
from tests.support.timing.looped_terminal import LoopedTerminal

MARKS = ("waits", "real_time")
TRIES = 4
STANDSTILL_S = 0.05  # the shortest time-out of a reply in these tests is 0.07 s
# Short ones in a row: a fifth of the time for which a moving stage may be silent.
LATE_S, WITHIN_S = 0.1, 0.5
# Of WITHIN_S, for all threads of the test: a request passes through several of them, one after the
# other, before its answer is read. The shortest time-out of a reply.
KEPT_WAITING_S = 0.07
# Of WITHIN_S, for a thread of a process of the test: two busy programs leave it half of the time.
STARVED_S = 0.3
STOLEN_S = 0.05  # of WITHIN_S, from one processor, as STANDSTILL_S
_TICK_S, _LOOK_S = 0.01, 0.1  # of the own thread; between two looks at other processes
_PROPERTY = "repeated"
_PROCESSORS = Path("/proc/stat")
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


class Standstills(Closeable):
    """Delays of a thread that wakes and exchanges two bytes every 10 ms, within a `with` block.

    longest_s: the longest. late_s: the largest sum of those within WITHIN_S. kept_waiting_s,
    starved_s: the longest time within WITHIN_S for which all threads of the test together, or one
    of a child process, were kept from running. stolen_s: the longest time within WITHIN_S for which
    the host took one processor away. terminal: what the bytes pass through. looks: the last
    looks at the threads of children; looked: number of all.
    """

    def __init__(self) -> None:
        self.longest_s = self.late_s = 0.0
        self.kept_waiting_s = self.starved_s = self.stolen_s = 0.0
        self.looks: deque[dict[int, float]] = deque(maxlen=1 + round(WITHIN_S / _LOOK_S))
        self.looked = 0
        self._stolen: deque[dict[int, float]] = deque([stolen_s()], maxlen=self.looks.maxlen)
        self._own_waits_s: deque[float] = deque(maxlen=round(WITHIN_S / _LOOK_S))
        self._waited_s = threads_waited_s(os.getpid())
        self.terminal = LoopedTerminal()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._measure, daemon=True, name="standstills")
        self._thread.start()

    def close(self) -> None:
        """Measure no more; may be called twice."""
        self._done.set()
        self._thread.join()
        self.terminal.close()

    def go_on(self) -> None:
        """Measure a little longer: a thread's wait is counted only once it runs again."""
        self._done.wait(WITHIN_S)

    def _measure(self) -> None:
        woken_s = time.monotonic()
        delays_s: deque[tuple[float, float]] = deque()
        looked_s = woken_s
        while not self._done.wait(_TICK_S):
            self.terminal.exchange()
            now_s = time.monotonic()
            delay_s, woken_s = now_s - woken_s - _TICK_S, now_s
            self.longest_s = max(self.longest_s, delay_s)
            delays_s.append((now_s, delay_s))
            while delays_s[0][0] < now_s - WITHIN_S:
                delays_s.popleft()
            self.late_s = max(self.late_s, sum(delay for _, delay in delays_s))
            if now_s - looked_s >= _LOOK_S:
                looked_s = now_s
                self._look()
        self._look()

    def _look(self) -> None:
        self.looks.append(waited_s(os.getpid()))
        self.starved_s = max(self.starved_s, _longest_s(self.looks))
        self._stolen.append(stolen_s())
        self.stolen_s = max(self.stolen_s, _longest_s(self._stolen))
        before, now = self._waited_s, threads_waited_s(os.getpid())
        now.pop(threading.get_native_id(), None)  # this one wakes often, and is in nobody's way
        self._own_waits_s.append(sum(s - before.get(thread, 0.0) for thread, s in now.items()))
        self._waited_s = now
        self.kept_waiting_s = max(self.kept_waiting_s, sum(self._own_waits_s))
        self.looked += 1

    @property
    def cause(self) -> str:
        """What kept the test from running, empty if nothing did."""
        if self.longest_s > STANDSTILL_S:
            return f"{self.longest_s:.2f} s"
        if self.late_s > LATE_S:
            return f"{self.late_s:.2f} s of {WITHIN_S} s"
        if self.kept_waiting_s > KEPT_WAITING_S:
            return f"{self.kept_waiting_s:.2f} s of {WITHIN_S} s, in its threads"
        if self.stolen_s > STOLEN_S:
            return f"{self.stolen_s:.2f} s of {WITHIN_S} s, taken by the host of a virtual machine"
        starved = f"{self.starved_s:.2f} s of {WITHIN_S} s, in a process of the test"
        return starved if self.starved_s > STARVED_S else ""


def waited_s(process: int) -> dict[int, float]:
    """Return how long each thread of a process's descendants was ready to run and did not, in s."""
    found: dict[int, float] = {}
    for child in _children(process):
        found |= threads_waited_s(child) | waited_s(child)
    return found


def threads_waited_s(process: int) -> dict[int, float]:
    """Return how long each thread of a process was ready to run and did not, in s.

    Second number of /proc/PID/task/TID/schedstat (Linux, sched-stats.rst), in ns.
    """
    found: dict[int, float] = {}
    for thread in Path(f"/proc/{process}/task").glob("*"):
        with suppress(OSError):  # it has ended
            waited = (thread / "schedstat").read_text().split()[1]
            found[int(thread.name)] = 1e-9 * int(waited)
    return found


def stolen_s() -> dict[int, float]:
    """Return for how long the host has taken each processor away, in s; none where it is not told.

    Eighth number of a processor's line in /proc/stat (Linux, filesystems/proc.rst: steal), in
    ticks.
    """
    found: dict[int, float] = {}
    with suppress(OSError):  # another system than Linux
        for line in _PROCESSORS.read_text().splitlines():
            name, *numbers = line.split()
            if name.startswith("cpu") and name != "cpu":  # the first line is the sum of all
                found[int(name.removeprefix("cpu"))] = int(numbers[7]) / _TICKS_PER_S
    return found


def _longest_s(looks: deque[dict[int, float]]) -> float:
    """Longest increase of one thread's or processor's time between the first and the last look."""
    first, last = looks[0], looks[-1]
    return max((waited - first.get(number, 0.0) for number, waited in last.items()), default=0.0)


def _children(process: int) -> list[int]:
    """Return the numbers of the child processes; none where the kernel does not list them."""
    found: list[int] = []
    for thread in Path(f"/proc/{process}/task").glob("*"):
        with suppress(OSError):
            found += map(int, (thread / "children").read_text().split())
    return found


def is_repeated(item: pytest.Item) -> bool:
    """Return True for a test in real time on emulated devices; a real one moves but once."""
    return any(map(item.get_closest_marker, MARKS)) and not item.get_closest_marker("hil")


def run_in_real_time(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Run a test, and again if it, or a fixture of it, failed while the machine stood still.

    The last time is reported.
    """
    item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    causes: list[str] = []
    while True:
        with Standstills() as standstills:
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            if any(r.failed for r in reports):
                standstills.go_on()
        cause = standstills.cause
        if not cause or len(causes) + 1 == TRIES or not any(r.failed for r in reports):
            break
        causes.append(cause)
        if any(r.failed and r.when == "setup" for r in reports):
            # A module's or session's fixture: pytest keeps its error until it is torn down.
            item.session._setupstate.teardown_exact(None)
    for report in reports:
        if causes and (report.when == "call" or report.failed):
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
