"""Start of `scan_killer`, or of another killer, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.support.paths import ROOT


def run_scan_killer(
    arguments: list[object],
    environment: dict[str, str],
    timeout_s: float,
    module: str = "tests.support.storage.scan_killer",
) -> str:
    """Run the killer of a module with extra environment variables and return its output."""
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        env={**os.environ, **environment}, cwd=ROOT,
        capture_output=True, text=True, timeout=timeout_s, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout
