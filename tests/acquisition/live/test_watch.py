"""Command `gonio watch`: a run in the browser until Ctrl-C."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.command import gonio_here
from tests.support.live.page_client import Browser
from tests.support.live.runs import live_protocol, whole_run
from tests.support.paths import ROOT

pytestmark = [pytest.mark.waits, pytest.mark.usefixtures("own_folder")]


@contextmanager
def watching(*arguments: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The command and the first line that it prints."""
    with subprocess.Popen(
        [sys.executable, "-m", "acquisition", "watch", *map(str, arguments)], cwd=ROOT,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as command:  # fmt: skip
        assert command.stdout is not None
        try:
            yield command, command.stdout.readline()
        finally:
            command.kill()


def test_a_run_that_has_ended_is_shown_without_actions_until_ctrl_c(tmp_path: Path) -> None:
    run = whole_run(live_protocol(tmp_path), tmp_path / "run")
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    with watching(run) as (command, line):
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}\n", line)
        with Browser(line.strip()) as browser:
            browser.read_until(lambda one: len(one.points()) == 16)
            browser.read_until(lambda one: one.of("progress") is not None)
            assert browser.of("progress")["state"] == "finished"
            assert browser.of("progress")["actions"] == []
            command.send_signal(signal.SIGINT)
            out, err = command.communicate(timeout=60)
    assert (command.returncode, out, err) == (0, "", "")
    assert {path: path.stat().st_mtime_ns for path in run.iterdir()} == before


def test_what_is_no_run_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "nice", lambda _: 0)
    done = gonio_here("watch", tmp_path)
    assert done.returncode == 2
    assert done.stderr == f"{tmp_path}: no record.sqlite there: name the folder of a run\n"


@pytest.mark.parametrize("port", ["-1", "65536", "many"])
def test_a_port_is_a_number_that_a_computer_has(tmp_path: Path, port: str) -> None:
    done = gonio_here("watch", tmp_path, "--port", port)
    assert done.returncode == 2
    assert "--port" in done.stderr
