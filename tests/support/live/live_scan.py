"""Scan with a live page, by the command `gonio` in a process of its own."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.live.channel import SOCKET_FILE, channel_of
from instrument.record.record import FILE_NAME
from tests.support.paths import ROOT
from tests.support.timing.deadline import wait_for

DEADLINE_S = 120.0
_ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/\?token=[\w-]+")


@dataclass(frozen=True, slots=True)
class LiveScan:
    """Running command; `said` is what it has printed so far."""

    process: subprocess.Popen[bytes]
    output: Path

    @property
    def said(self) -> str:
        return self.output.read_text()

    @property
    def address(self) -> str:
        """Address of its page, as it is printed."""
        found = _ADDRESS.search(self.said)
        assert found, self.said
        return found[0]

    def exit_code(self) -> int:
        """Wait until it has ended."""
        return self.process.wait(DEADLINE_S)


def channel_of_scan(run: Path) -> Path:
    """Wait for the channel of a scan that is being started, and return its folder."""
    wait_for((run / FILE_NAME).exists, "the record", DEADLINE_S)
    folder = channel_of(run / FILE_NAME)
    wait_for((folder / SOCKET_FILE).exists, "the channel", DEADLINE_S)
    return folder


@contextmanager
def live_command(output: Path, *arguments: object) -> Iterator[LiveScan]:
    """Run the command in a `with` block, from when its page's address is printed."""
    command = [sys.executable, "-m", "acquisition", *map(str, arguments)]
    with output.open("wb") as said, subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
        start_new_session=True,
    ) as process:  # fmt: skip
        scan = LiveScan(process, output)
        try:
            wait_for(
                lambda: bool(_ADDRESS.search(scan.said)) or process.poll() is not None,
                "address of the live page",
                DEADLINE_S,
            )
            yield scan
        finally:
            process.terminate()
