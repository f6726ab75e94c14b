"""A stop reaches the wire within 100 ms: Ctrl-C, SIGTERM, or a failure of the scan's own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from benches import BENCHES
from conftest import ROOT

# A half-duplex line may still owe an answer: then one reply time-out more.
BOUND_S = {"newport": 0.1, "zaber": 0.1, "oriental rtu": 0.3, "oriental tcp": 0.3}


HOWS = {"SIGINT": "KeyboardInterrupt", "SIGTERM": "KeyboardInterrupt", "exception": "DeviceError"}


@pytest.mark.parametrize("bench", list(BENCHES))
def test_a_stop_is_on_the_wire_in_time(bench: str) -> None:
    tests = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, str(tests / "stop_child.py"), bench, *HOWS],
        capture_output=True, text=True, timeout=60, check=False, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tests}"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[::2] == list(HOWS.values())
    for how, figures in zip(HOWS, lines[1::2], strict=True):
        seconds, moving = figures.split()
        assert 0 <= float(seconds) < BOUND_S[bench], how
        assert moving == "False", how
