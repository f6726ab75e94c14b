"""The command `gonio` in a process of its own that gets a signal at a moment of its work."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.support.paths import ROOT

DEADLINE_S = 120.0


def struck(
    arguments: list[object], number: signal.Signals, cpu_s: float
) -> subprocess.CompletedProcess[str]:
    """Run the command and send a signal once it has its handlers and has computed for `cpu_s`.

    Computing time of its main thread, so that the moment does not depend on what else runs.
    """
    with subprocess.Popen(
        [sys.executable, "-m", "acquisition", *map(str, arguments)], cwd=ROOT, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:  # fmt: skip
        end_s = time.monotonic() + DEADLINE_S
        while process.poll() is None and not _is_due(process.pid, number, cpu_s):
            assert time.monotonic() < end_s, "the command does not come so far"
            time.sleep(0.001)
        process.send_signal(number)
        out, err = process.communicate(timeout=DEADLINE_S)
    return subprocess.CompletedProcess(arguments, process.returncode, out, err)


def _is_due(pid: int, number: signal.Signals, cpu_s: float) -> bool:
    """Return True once the signal is caught and the main thread has computed long enough.

    SIGTERM too: Python itself catches SIGINT, before the command does.
    """
    folder = Path(f"/proc/{pid}")
    try:
        status, schedule = (folder / "status").read_text(), (folder / "schedstat").read_text()
    except OSError:
        return False
    caught = int(status.partition("SigCgt:")[2].split()[0], 16)
    handled = all(caught >> (n - 1) & 1 for n in (signal.SIGTERM, number))
    return handled and int(schedule.split()[0]) >= cpu_s * 1e9
