"""Cost of the live page to a scan in real time: a browser, a client that reads, one that stalls.

The scan time of a point is the engine's own, without homing and darks: the difference between first
and last reading over their number.
"""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from instrument.record.record import Record
from tests.support.analysis.no_charts import WITHOUT_CHARTS
from tests.support.live.chromium import missing
from tests.support.live.watching_browser import WatchingBrowser, watching_browser
from tests.support.paths import ROOT
from tests.support.scans import TWO_MODELS, small_demo
from tests.support.whole_scans.simulated_rig import EMULATED_RIG, quick_emulated_rig

pytest.importorskip("uvicorn", reason="the live page's libraries are not installed")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(
        shutil.which("cc") is None, reason="the emulated camera needs a C compiler (cc)"
    ),
]
MOST = 1.02  # of the time of a scan that nobody watches
MOST_OF_ONE = 1.6  # of one pair of short scans: 0.77 to 1.25 beside other work


@contextmanager
def client(address: str, *, stalled: bool) -> Iterator[None]:
    """Read the page's messages, or ask for them and read nothing."""
    parts = urlsplit(address)
    with socket.create_connection((parts.hostname, parts.port)) as line:
        request = f"GET /events?{parts.query} HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n"
        line.sendall(request.encode())
        reader = threading.Thread(target=_read_all, args=(line,), daemon=True)
        if not stalled:
            reader.start()
        yield
        with suppress(OSError):  # the page has ended first
            line.shutdown(socket.SHUT_RDWR)


def _read_all(line: socket.socket) -> None:
    try:
        while line.recv(65536):
            pass
    except OSError:
        return


def time_a_point_s(
    folder: Path,
    protocol: Path,
    rig: Path,
    *,
    watched: bool,
    browser: WatchingBrowser | None = None,
) -> float:
    """Scan, watched by the browser and two clients or by nobody; return seconds a point."""
    files: list[str | Path] = [protocol, "--rig", rig, "--out", folder]
    command = [sys.executable, "-c", WITHOUT_CHARTS, "run", *files]
    with (
        subprocess.Popen(
            [*command, *["--live"] * watched], cwd=ROOT, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        ) as scan,
        ExitStack() as clients,
    ):  # fmt: skip
        assert scan.stderr is not None
        said = ""
        for text in scan.stderr:
            said += text
            if found := re.search(r"live page: (\S+)", text):
                if browser is not None:
                    browser.show(found[1])
                for stalled in (False, True):
                    clients.enter_context(client(found[1], stalled=stalled))
        assert scan.wait(120) == 0, said
    assert ("live page" in said) == watched
    with Record.open(folder) as record:
        times = [reading.free_s for reading in record.readings()]
    return (times[-1] - times[0]) / (len(times) - 1)


def time_a_pair_s(
    folder: Path, protocol: Path, rig: Path, *, with_browser: bool
) -> tuple[float, float]:
    """Seconds a point of a scan that nobody watches, and of the same scan watched."""
    alone_s = time_a_point_s(folder / "alone", protocol, rig, watched=False)
    if not with_browser:
        return alone_s, time_a_point_s(folder / "watched", protocol, rig, watched=True)
    with watching_browser() as browser:
        watched_s = time_a_point_s(folder / "watched", protocol, rig, watched=True, browser=browser)
        browser.require_shown()
    return alone_s, watched_s


@pytest.mark.real_time
def test_two_clients_one_of_them_stalled_cost_a_scan_no_time(tmp_path: Path) -> None:
    """One pair of short scans, whose limit is therefore wide."""
    protocol, rig = small_demo(tmp_path, TWO_MODELS), tmp_path / "rig.yaml"
    rig.write_text(quick_emulated_rig().replace("frames_per_s: 400", "frames_per_s: 100"))
    alone_s, watched_s = time_a_pair_s(tmp_path, protocol, rig, with_browser=False)
    assert watched_s / alone_s < MOST_OF_ONE


@pytest.mark.slow
def test_a_browser_and_two_clients_one_of_them_stalled_cost_a_scan_no_time(
    tmp_path: Path, slow: bool, record_property: Callable[[str, object], None]
) -> None:
    """Medians of five pairs on a machine that does nothing else.

    It is not repeated where the machine stood still: the browser may be the reason.
    """
    if not slow:
        pytest.skip("with --slow")
    if missing():
        pytest.skip(missing())
    protocol = small_demo(tmp_path, TWO_MODELS)
    protocol.write_text(protocol.read_text().replace("num: 9", "num: 33"))
    pairs = [
        time_a_pair_s(tmp_path / f"{n}", protocol, EMULATED_RIG, with_browser=True)
        for n in range(5)
    ]
    alone_s, watched_s = np.median(pairs, axis=0)
    record_property("time of a point alone, in s", float(alone_s))
    record_property("watched / alone", float(watched_s / alone_s))
    assert watched_s / alone_s < MOST, pairs
