"""Tests in real time are repeated where the machine stood still, and only there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.support.paths import ROOT
from tests.support.timing.standstill import TRIES

CONFTEST = """
import pytest
from tests.support.timing import standstill

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
import ctypes, pathlib, pytest, time

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
NAMES = ("twice", "short", "shared", "always", "passes")


def test_a_failure_in_a_standstill_is_repeated_and_any_other_counts(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    (tmp_path / "test_it.py").write_text(TESTS)
    command = f"import sys, pytest; sys.path.insert(0, {str(ROOT)!r}); sys.exit(pytest.main())"
    alone = ["-p", "no:xdist", "-p", "no:cacheprovider", "--rootdir", "."]
    done = subprocess.run(
        [sys.executable, "-c", command, *alone],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    times = {name: len((tmp_path / name).read_text()) for name in NAMES}
    wanted = {"twice": 3, "short": 2, "shared": 3, "always": TRIES, "passes": 1}
    assert times == wanted, done.stdout
    assert "2 failed, 5 passed" in done.stdout
    repeated = "test_fails_twice_in_a_standstill: repeated, as the machine stood still for 0."
    assert repeated in done.stdout
    if (
        "test_fails_without_a_standstill: repeated" not in done.stdout
    ):  # a busy machine stands still
        assert len((tmp_path / "without").read_text()) == 1
