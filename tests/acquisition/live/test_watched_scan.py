"""Scan that is watched: paused and aborted from outside or by a key, and what that leaves."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from acquisition.live import channel
from instrument.record.event_kinds import DRIFT, OPERATOR, STOPPED
from instrument.record.record import Record
from tests.support.command import gonio_here
from tests.support.live.live_scan import channel_of_scan
from tests.support.paths import CONFIGS, ROOT
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.terminal.session import TerminalSession
from tests.support.timing.deadline import wait_for

pytestmark = [pytest.mark.waits, pytest.mark.usefixtures("own_folder")]

LONG_S = 120.0


def the_scan(run: Path) -> tuple[object, ...]:
    """Python's arguments; with the bench's own pictures there is time enough to pause the scan."""
    files = (small_demo(run.parent, TWO_MODELS), "--rig", CONFIGS / "rigs" / "bench_12bit.yaml")
    return ("-m", "acquisition", "run", *files, "--out", run)


@contextmanager
def scanning(run: Path) -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """Run the demonstration, paused as soon as it can be; yield its process and its channel."""
    with subprocess.Popen(
        [sys.executable, *the_scan(run)], cwd=ROOT,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            folder = channel_of_scan(run)
            assert channel.send(folder, channel.PAUSE) == channel.OK
            yield process, folder
        finally:
            process.kill()


@contextmanager
def paused_at_a_terminal(run: Path) -> Iterator[TerminalSession]:
    """Run the demonstration at a terminal, and press the key that pauses it, once it is told."""
    with TerminalSession(the_scan(run)) as session:
        session.read_until("p pauses the scan and lets it go on; Ctrl-C stops it", LONG_S)
        session.press("p")
        session.read_until("paused at theta_i ", LONG_S)
        yield session


def phase(folder: Path) -> str:
    channel.send(folder, channel.WATCH)
    return str((channel.read_state(folder) or {}).get("phase"))


def test_a_pause_from_outside_stands_until_it_is_lifted_and_every_point_is_measured(
    tmp_path: Path,
) -> None:
    run = tmp_path / "run"
    with scanning(run) as (process, folder):
        wait_for(lambda: phase(folder) == "paused", "a pause", LONG_S)
        state = channel.read_state(folder) or {}
        assert state["lamp"] == "lit"
        assert not any(axis["moving"] for axis in state["axes"].values())
        assert channel.send(folder, channel.RESUME) == channel.OK
        process.communicate(timeout=LONG_S)
        assert process.returncode == 0
    assert not folder.exists()
    with Record.open(run) as record:
        assert len(record.readings()) == int(record.meta("steps") or 0)
        texts = [text for _, kind, text in record.events() if kind == OPERATOR]
    assert sum(text.startswith("paused on the live page: theta_i ") for text in texts) == 1
    assert sum(text.startswith("continued on the live page after ") for text in texts) == 1


def test_an_abort_in_a_pause_leaves_a_safe_rig_and_a_run_that_resumes(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with scanning(run) as (process, folder):
        wait_for(lambda: phase(folder) == "paused", "a pause", LONG_S)
        assert channel.send(folder, channel.ABORT) == channel.OK
        _, said = process.communicate(timeout=LONG_S)
    assert process.returncode == 4
    assert "stopped by the operator on the live page: all motion has ended." in said
    assert f"gonio resume {run}" in said
    with Record.open(run) as record:
        stopped = [text for _, kind, text in record.events() if kind == STOPPED]
        assert stopped == ["stopped by the operator on the live page"]
    assert gonio_here("resume", run, "--yes").returncode == 0
    assert json.loads((run / "fit.json").read_text())["verdict"] == "adequate"


def test_the_key_p_pauses_the_scan_and_lets_it_go_on(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with paused_at_a_terminal(run) as session:
        session.press("p")
        session.read_until("goes on after ", LONG_S)
        assert session.wait(LONG_S) == 0, session.text
        assert session.is_as_before
    with Record.open(run) as record:
        kinds = [kind for _, kind, _ in record.events()]
        texts = [text for _, kind, text in record.events() if kind == OPERATOR]
    assert any(text.startswith("paused at the terminal: ") for text in texts)
    assert kinds.count(DRIFT) <= 1


def test_ctrl_c_in_a_pause_stops_the_scan_and_gives_the_terminal_back(tmp_path: Path) -> None:
    run = tmp_path / "run"
    with paused_at_a_terminal(run) as session:
        session.press("\x03")
        assert session.wait(LONG_S) == 4, session.text
        assert session.is_as_before
        assert "stopped by the operator: all motion has ended." in session.text
