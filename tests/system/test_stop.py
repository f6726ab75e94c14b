"""A stop reaches the wire within 100 ms: Ctrl-C, SIGTERM, or a failure of the scan's own."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.paths import ROOT
from tests.support.stages.emulated_stages import EMULATED_STAGES

# A half-duplex line may still owe an answer: then one reply time-out more.
BOUND_S = {"newport": 0.1, "zaber": 0.1, "oriental rtu": 0.3, "oriental tcp": 0.3}


HOWS = {"SIGINT": "KeyboardInterrupt", "SIGTERM": "KeyboardInterrupt", "exception": "DeviceError"}


@pytest.mark.parametrize("bench", list(EMULATED_STAGES))
def test_a_stop_is_on_the_wire_in_time(bench: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.stages.stop_child", bench, *HOWS],
        capture_output=True, text=True, timeout=60, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[::2] == list(HOWS.values())
    for how, figures in zip(HOWS, lines[1::2], strict=True):
        seconds, moving = figures.split()
        assert 0 <= float(seconds) < BOUND_S[bench], how
        assert moving == "False", how
