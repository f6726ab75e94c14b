"""A stop is on the wire within 100 ms after Ctrl-C, SIGTERM or a failure of the scan itself."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.support.paths import ROOT
from tests.support.stages.emulated_stages import EMULATED_STAGES
from tests.support.stages.kinds import KINDS

pytestmark = pytest.mark.real_time

# On a half-duplex line a reply may be pending: one reply time-out more.
BOUND_S = {name: 0.1 if kind.full_duplex else 0.3 for name, kind in KINDS.items()}
CAUSES = {"SIGINT": "KeyboardInterrupt", "SIGTERM": "KeyboardInterrupt", "exception": "DeviceError"}


@pytest.mark.parametrize("emulated", list(EMULATED_STAGES))
def test_a_stop_is_on_the_wire_in_time(emulated: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.stages.stop_child", emulated, *CAUSES],
        capture_output=True, text=True, timeout=60, check=False, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[::2] == list(CAUSES.values())
    for cause, figures in zip(CAUSES, lines[1::2], strict=True):
        seconds, moving = figures.split()
        assert 0 <= float(seconds) < BOUND_S[emulated], cause
        assert moving == "False", cause
