"""Start of `scan_killer` in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.support.paths import ROOT


def run_scan_killer(arguments: list[object], environment: dict[str, str], timeout_s: float) -> str:
    """Run the killer with extra environment variables and return its output."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.storage.scan_killer", *map(str, arguments)],
        env={**os.environ, **environment}, cwd=ROOT,
        capture_output=True, text=True, timeout=timeout_s, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout
