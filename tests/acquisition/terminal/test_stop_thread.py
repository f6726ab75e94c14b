"""Threads of a stop: they act and speak while the main thread waits for a disk that hangs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

DEADLINE_S = 60.0
HANGING = """
import os, sys
from acquisition.terminal import stop_signals
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.stop_thread import stopped_by_signals
from instrument.errors import DeviceError

def stop():
    os.write(int(sys.argv[1]), b"stopped\\n")
    if sys.argv[3]:
        raise DeviceError(sys.argv[3])

stop_signals.begin()
with orderly_end(), stopped_by_signals({"theta_r": stop}), open(sys.argv[2], "w") as file:
    os.write(int(sys.argv[1]), b"ready\\n")  # imports may wait for the disk as well
    os.fsync(file.fileno())
"""


@contextmanager
def hanging(trouble: str, hung_disk: dict[str, str], tmp_path: Path) -> Iterator[tuple]:
    """A process whose main thread waits for the disk, its pipe, and what it prints."""
    Path(hung_disk["GONIO_HUNG_DISK"]).touch()
    reading, writing = os.pipe()
    printed = tmp_path / "printed"
    with os.fdopen(reading, encoding="utf-8") as said, printed.open("w") as text:
        process = subprocess.Popen(
            [sys.executable, "-c", HANGING, str(writing), tmp_path / "file", trouble], cwd=ROOT,
            stderr=text, pass_fds=[writing], env={**os.environ, **hung_disk},
        )  # fmt: skip
        os.close(writing)
        patience = threading.Timer(DEADLINE_S, process.kill)
        patience.start()
        try:
            assert said.readline() == "ready\n"
            wait_until(lambda: _waits_for_disk(process.pid), DEADLINE_S)
            yield process, said, printed
        finally:
            patience.cancel()
            process.kill()
            process.wait()
            Path(hung_disk["GONIO_HUNG_DISK"]).unlink()


def _waits_for_disk(pid: int) -> bool:
    return "disk sleep" in Path(f"/proc/{pid}/status").read_text()


@pytest.mark.parametrize(
    ("trouble", "motion"),
    [
        ("", "stopped by the operator (SIGTERM): all motion has ended. The program waits"),
        ("no answer", "LOOK AT THE RIG FIRST: theta_r: no answer\nstopped by the operator"),
    ],
)
def test_an_axis_is_stopped_while_the_main_thread_waits_for_a_disk(
    trouble: str, motion: str, hung_disk: dict[str, str], tmp_path: Path
) -> None:
    """As the thread of a move would, were it to write; a second signal then ends the program."""
    with hanging(trouble, hung_disk, tmp_path) as (process, said, printed):
        process.send_signal(signal.SIGTERM)
        assert said.readline() == "stopped\n"
        wait_until(lambda: motion in printed.read_text(), DEADLINE_S)
        assert _waits_for_disk(process.pid)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 4
        assert printed.read_text().endswith("the program hung and was ended\n")


SWALLOWING = """
import sys, time
from acquisition.terminal import stop_signals
from acquisition.terminal.orderly_end import orderly_end

class Swallowing:
    def __del__(self):
        print("sleeps", flush=True)
        time.sleep(60.0)

def turned_into_another():
    print("sleeps", flush=True)
    try:
        time.sleep(60.0)
    except KeyboardInterrupt:
        raise ImportError("numpy.core.multiarray failed to import")

stop_signals.begin()
try:
    with orderly_end():
        match sys.argv[1]:
            case "destructor":
                Swallowing()
            case "library":
                turned_into_another()
            case "code of a string":
                exec("print('sleeps', flush=True); time.sleep(60.0)")
        time.sleep(60.0)
except KeyboardInterrupt as stop:
    print(stop)
stop_signals.ended(0)
"""


@pytest.mark.parametrize("where", ["destructor", "library", "code of a string"])
def test_a_signal_that_code_swallows_or_turns_into_an_error_still_stops(where: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", SWALLOWING, where], cwd=ROOT, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "sleeps\n"
        process.send_signal(signal.SIGQUIT)
        out, err = process.communicate(timeout=DEADLINE_S)
    assert (out, err, process.returncode) == ("stopped by the operator (SIGQUIT)\n", "", 0)


ENDING = """
import signal
from unittest.mock import patch
from acquisition.terminal import stop_signals
from tests.support import command

def stopped_in_no_orderly_block():
    stop_signals.begin()
    signal.raise_signal(signal.SIGINT)

with patch.object(command, "main", stopped_in_no_orderly_block):
    command.gonio_here("run")
"""


def test_a_command_that_ends_the_process_of_the_tests_shows_where() -> None:
    """Its own message is lost with its captured output."""
    done = subprocess.run(
        [sys.executable, "-c", ENDING], cwd=ROOT, text=True, capture_output=True, check=False,
        timeout=DEADLINE_S,
    )  # fmt: skip
    assert done.returncode == 4
    assert "stopped_in_no_orderly_block" in done.stderr
    assert "in end_at_once" in done.stderr
