"""Tests in real time are repeated where the machine stood still, and only there."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.timing import standstill
from tests.support.timing.deadline import wait_for
from tests.support.timing.looped_terminal import GIVEN_UP_S, LoopedTerminal
from tests.support.timing.standstill import (
    KEPT_WAITING_S,
    STANDSTILL_S,
    STARVED_S,
    STOLEN_S,
    TRIES,
    Standstills,
    stolen_s,
    waited_s,
)

CONFTEST = """
import pathlib, pytest
from tests.support.timing import standstill

# A wait that is counted once a test has made a file.
standstill.threads_waited_s = lambda _: {1: float(pathlib.Path("counted").exists())}

def pytest_configure(config):
    config.addinivalue_line("markers", "waits: in real time")

def pytest_runtest_protocol(item, nextitem):
    standstill.run_in_real_time(item, nextitem)
    return True

def pytest_terminal_summary(terminalreporter):
    reports = [r for kind in ("passed", "failed") for r in terminalreporter.getreports(kind)]
    for line in standstill.repetitions(reports):
        terminalreporter.write_line(line)
"""
# `stand_still` keeps every other thread of the process waiting: a call that holds Python's lock.
TESTS = """
import ctypes, pathlib, pytest, threading, time

def count(name):
    with pathlib.Path(name).open("a") as file:
        file.write("x")
    return len(pathlib.Path(name).read_text())

def stand_still():
    ctypes.PyDLL(None).usleep(200_000)

@pytest.fixture
def given():
    yield count("set up")

def test_fails_twice_in_a_standstill(given):
    assert given == count("twice")
    if given < 3:
        stand_still()
        assert not "failed"

def test_fails_once_in_short_standstills():
    if count("short") < 2:
        for _ in range(10):
            ctypes.PyDLL(None).usleep(40_000)
            time.sleep(0.005)
        assert not "failed"

def test_fails_once_before_its_wait_is_counted():
    if count("later") < 2:
        threading.Timer(0.1, pathlib.Path("counted").touch).start()
        assert not "failed"

@pytest.fixture(scope="module")
def shared():
    if count("shared") < 3:
        stand_still()
        assert not "failed"
    return "made"

def test_needs_a_fixture_that_fails_twice_in_a_standstill(shared):
    assert shared == "made"

def test_needs_the_same_fixture(shared):
    assert shared == "made"

def test_fails_always_in_a_standstill():
    count("always")
    stand_still()
    assert not "failed"

def test_fails_without_a_standstill():
    count("without")
    assert not "failed"

def test_passes_in_a_standstill():
    count("passes")
    stand_still()
"""
NAMES = ("twice", "short", "later", "shared", "always", "passes")


# One processor, of which the others leave the last next to nothing (sched(7): SCHED_IDLE).
SPIN = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
if sys.argv[2] == "starved":
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
print(flush=True)
while time.monotonic() < float(sys.argv[3]):
    pass
"""


def test_a_process_of_the_test_that_is_kept_from_running_is_a_standstill() -> None:
    """The test's own thread, which sleeps, notices nothing of it."""
    processor, until_s = str(min(os.sched_getaffinity(0))), str(time.monotonic() + 1.5)
    with Standstills() as standstills, ExitStack() as stack:
        for kind in ("busy", "busy", "starved"):
            command = [sys.executable, "-c", SPIN, processor, kind, until_s]
            child = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
            stack.callback(child.kill)
        wait_for(lambda: standstills.starved_s > STARVED_S, "a starved process")
    assert standstills.cause


def test_a_thread_of_the_test_that_is_kept_from_running_is_a_standstill() -> None:
    """One that computes waits longer than the thread that measures, which sleeps."""
    processor, until_s = str(min(os.sched_getaffinity(0))), str(time.monotonic() + 1.5)
    with ExitStack() as stack:
        for _ in range(3):
            command = [sys.executable, "-c", SPIN, processor, "busy", until_s]
            child = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE))
            stack.callback(child.kill)
        with Standstills() as standstills, on_processor(int(processor)):
            while standstills.kept_waiting_s <= KEPT_WAITING_S:
                assert time.monotonic() < float(until_s)
    assert standstills.cause


def test_short_waits_of_several_threads_in_turn_are_a_standstill(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One of them has ended before the last look."""
    looks = [{1: 5.0}, {1: 5.04, 2: 0.03}, {1: 5.05, 3: 0.04}]
    monkeypatch.setattr(standstill, "threads_waited_s", lambda _: dict(looks[0]))
    with Standstills() as standstills:
        for look in looks[1:]:
            looks[0] = look
            _look_twice(standstills)
    assert standstills.kept_waiting_s == pytest.approx(0.12)
    assert standstills.cause


def test_a_processor_that_the_host_takes_away_is_a_standstill(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """From one processor at once; the others have lost as much in their whole life."""
    table = tmp_path / "stat"
    monkeypatch.setattr(standstill, "_PROCESSORS", table)
    line = "cpu{0} 11 12 13 14 15 16 17 {1} 19 20\n"
    table.write_text(line.format("", 9) + line.format(0, 4) + line.format(1, 5) + "intr 1 2\n")
    per_s = os.sysconf("SC_CLK_TCK")
    assert stolen_s() == {0: 4 / per_s, 1: 5 / per_s}
    with Standstills() as standstills:
        _look_twice(standstills)
        assert standstills.stolen_s == 0.0
        later = tmp_path / "later"
        later.write_text(line.format(0, 4) + line.format(1, 5 + round(0.16 * per_s)))
        later.replace(table)  # at once: it is being read
        _look_twice(standstills)
    assert standstills.stolen_s == pytest.approx(0.16)
    assert standstills.stolen_s > STOLEN_S
    assert standstills.cause


def test_where_no_table_of_processors_is_none_is_taken_away(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(standstill, "_PROCESSORS", tmp_path / "none")
    assert stolen_s() == {}
    with Standstills() as standstills:
        _look_twice(standstills)
    assert standstills.stolen_s == 0.0


def test_bytes_that_a_pseudo_terminal_holds_are_a_standstill() -> None:
    """The kernel's thread that carries them waits, and every thread of the test runs."""
    with Standstills() as standstills:
        _, port = standstills.terminal.ends
        termios.tcflow(port, termios.TCOOFF)
        held_s = time.monotonic()
        wait_for(lambda: time.monotonic() - held_s > 4 * STANDSTILL_S, "a while")
        termios.tcflow(port, termios.TCOON)
        _look_twice(standstills)
    assert standstills.longest_s > 2 * STANDSTILL_S
    assert standstills.cause


def test_a_byte_that_never_arrives_does_not_hold_the_test() -> None:
    """A terminal that waits for whole lines hands out no single byte."""
    with LoopedTerminal() as terminal:
        controller, port = terminal.ends
        settings = termios.tcgetattr(port)
        settings[3] |= termios.ICANON
        termios.tcsetattr(port, termios.TCSANOW, settings)
        begun_s = time.monotonic()
        terminal.exchange()
        assert time.monotonic() - begun_s > 0.9 * GIVEN_UP_S
        assert not select.select([controller], [], [], 0)[0]  # the other byte has arrived
    terminal.close()


def _look_twice(standstills: Standstills) -> None:
    wait_for(partial(_has_looked, standstills, standstills.looked + 2), "two looks")


def _has_looked(standstills: Standstills, times: int) -> bool:
    return standstills.looked >= times


@contextmanager
def on_processor(number: int) -> Iterator[None]:
    """Keep this thread on one processor."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {number})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def test_a_process_that_sleeps_or_waits_is_none() -> None:
    child = [sys.executable, "-c", "import sys; print(flush=True); sys.stdin.read()"]
    with subprocess.Popen(child, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as sleeping:
        assert sleeping.stdout is not None
        sleeping.stdout.readline()
        waited = waited_s(os.getpid())
        assert sleeping.pid in waited
        with Standstills() as standstills:
            wait_for(lambda: len(standstills.looks) > 3, "looks at the processes")
        assert waited_s(os.getpid())[sleeping.pid] - waited[sleeping.pid] < STARVED_S / 2
        sleeping.kill()


def test_a_failure_in_a_standstill_is_repeated_and_any_other_counts(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_it.py").write_text(TESTS)
    command = f"import sys, pytest; sys.path.insert(0, {str(ROOT)!r}); sys.exit(pytest.main())"
    alone = ["-p", "no:cacheprovider", "--rootdir", "."]
    done = subprocess.run(
        [sys.executable, "-c", command, *alone],
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    times = {name: len((tmp_path / name).read_text()) for name in NAMES}
    wanted = {"twice": 3, "short": 2, "later": 2, "shared": 3, "always": TRIES, "passes": 1}
    assert times == wanted, done.stdout
    assert "2 failed, 6 passed" in done.stdout
    repeated = "test_fails_twice_in_a_standstill: repeated, as the machine stood still for 0."
    assert repeated in done.stdout
    if (
        "test_fails_without_a_standstill: repeated" not in done.stdout
    ):  # a busy machine stands still
        assert len((tmp_path / "without").read_text()) == 1
