"""A closed terminal stops a scan like SIGTERM, whoever reads: axis, lamp, event, exit code."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.support.paths import CONFIGS, ROOT
from tests.support.stages.hangup_child import PROTOCOL

pytestmark = pytest.mark.waits

DEADLINE_S = 300.0
ON_THE_WIRE_S = 0.5  # measured: 5 ms; the bound is for a busy machine


@dataclass(frozen=True)
class Outcome:
    code: int
    stop_after_s: float
    moving: bool
    lit: bool
    events: list[tuple[str, str]]


def scan(folder: Path, standard: int, strike: Callable[[int], None], *command: str) -> Outcome:
    """Run the scan on the descriptor `standard`; `strike(pid)` once the axis is under way.

    The descriptor is closed here as soon as the scan has it.
    """
    rig = CONFIGS / "rigs" / "bench_12bit.yaml"
    (folder / "protocol.yaml").write_text(PROTOCOL.format(rig=rig))
    reading, writing = os.pipe()
    with os.fdopen(reading, encoding="utf-8") as said:
        child = [sys.executable, "-m", "tests.support.stages.hangup_child", str(writing)]
        with subprocess.Popen(
            [*command, *child, str(folder)], cwd=ROOT, stdin=standard, stdout=standard,
            stderr=standard, pass_fds=[writing], start_new_session=True,
        ) as scanning:  # fmt: skip
            os.close(writing)
            os.close(standard)
            assert said.readline() == "moving\n"
            struck_s = time.monotonic()
            strike(scanning.pid)
            code, stops, moving, lit = json.loads(said.readline())
            scanning.wait(DEADLINE_S)
    after_s = [at_s - struck_s for at_s in stops if at_s >= struck_s]
    assert after_s, "no stop on the wire"
    with sqlite3.connect(f"file:{folder / 'run' / 'record.sqlite'}?mode=ro", uri=True) as record:
        events = record.execute("SELECT kind, text FROM event ORDER BY id").fetchall()
    return Outcome(code, after_s[0], moving, lit, events)


def full_pipe(opened: ExitStack) -> int:
    """Return the writing end of a pipe that takes no more, and whose reader does not read."""
    reading, writing = os.pipe()
    opened.callback(os.close, reading)
    os.set_blocking(writing, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writing, bytes(4096))
    os.set_blocking(writing, True)
    return writing


def broken_pipe() -> int:
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def require_stopped(outcome: Outcome, why: str) -> None:
    assert outcome.code == 4
    assert outcome.stop_after_s < ON_THE_WIRE_S
    assert not outcome.moving
    assert not outcome.lit
    assert ("stopped", why) in outcome.events


def test_a_terminal_that_is_closed_stops_the_scan(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    outcome = scan(tmp_path, theirs, lambda _: os.close(ours))
    require_stopped(outcome, "stopped: the terminal was closed (SIGHUP)")


def test_a_hangup_stops_a_scan_whose_reader_has_gone(tmp_path: Path) -> None:
    outcome = scan(tmp_path, broken_pipe(), lambda pid: os.kill(pid, signal.SIGHUP))
    require_stopped(outcome, "stopped: the terminal was closed (SIGHUP)")


def test_a_reader_that_has_stalled_does_not_hold_up_the_stop(tmp_path: Path) -> None:
    """As after Ctrl-S in the terminal: every write would wait."""
    with ExitStack() as opened:
        pipe = full_pipe(opened)
        outcome = scan(tmp_path, pipe, lambda pid: os.kill(pid, signal.SIGQUIT))
    require_stopped(outcome, "stopped by the operator (SIGQUIT)")


def test_a_scan_under_nohup_is_not_stopped_by_a_closed_terminal(tmp_path: Path) -> None:
    """SIGHUP ignored from the beginning stays ignored; SIGTERM then ends the scan."""

    def strike(pid: int) -> None:
        os.kill(pid, signal.SIGHUP)
        os.kill(pid, signal.SIGTERM)

    ignoring = [
        sys.executable, "-c", "import os, signal, sys; signal.signal(signal.SIGHUP, "
        "signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])",
    ]  # fmt: skip
    outcome = scan(tmp_path, broken_pipe(), strike, *ignoring)
    require_stopped(outcome, "stopped by the operator (SIGTERM)")
