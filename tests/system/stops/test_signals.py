"""A signal at any moment of a command ends it with an exit code of the program, and one line."""

from __future__ import annotations

import random
import signal
from pathlib import Path

import pytest

from tests.support.command import gonio_here
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.whole_scans.struck_command import struck

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGQUIT, signal.SIGHUP)
TRIALS, SLOW_TRIALS = 8, 240
SHARE = ("help", "models", "help", "models", "fit", "help", "models", "fit", "report", "run")
# Seconds of computing that each command takes on a quick machine; a moment may come after its end.
COMPUTING_S = {"help": 0.12, "models": 0.5, "fit": 1.2, "report": 2.0, "run": 2.5}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    done = gonio_here("run", small_demo(folder, TWO_MODELS), "--out", folder / "run")
    assert done.returncode == 0, done.stderr
    return folder


def arguments(command: str, finished: Path, tmp_path: Path) -> list[object]:
    match command:
        case "help":
            return ["--help"]
        case "models":
            return ["models"]
        case "run":
            return ["run", finished / "small.yaml", "--out", tmp_path / "new"]
        case _:
            return [command, finished / "run"]


@pytest.mark.slow
def test_a_signal_at_any_moment_ends_in_the_table_of_exit_codes(
    finished: Path, tmp_path: Path, slow: bool
) -> None:
    chance = random.Random(16)
    for number in range(SLOW_TRIALS if slow else TRIALS):
        command = SHARE[number % len(SHARE)]
        cpu_s = COMPUTING_S[command] * chance.random() ** 2  # rather early than late
        stop = chance.choice(STOPS)
        folder = tmp_path / str(number)
        done = struck(arguments(command, finished, folder), stop, cpu_s)
        what = f"trial {number}: {command}, {stop.name} after {cpu_s:.3f} s:\n{done.stderr}"
        assert done.returncode in (0, 4), f"exit {done.returncode}: {what}"
        assert "Traceback" not in done.stderr, what
        assert "Exception ignored" not in done.stderr, what
        assert done.returncode == 0 or "stopped" in done.stderr.splitlines()[-1], what
