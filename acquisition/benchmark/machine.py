"""Processor, operating system and library versions of the machine that a benchmark ran on."""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from acquisition.results.versions import LIBRARIES, versions_of


def machine() -> dict[str, str]:
    """Return processor, cores, operating system, versions and date, by name."""
    found = {
        "processor": _processor(),
        "cores": str(os.cpu_count() or "unknown"),
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
        "Python": platform.python_version(),
    }
    found |= versions_of("gonio", *LIBRARIES)
    return found | {"date": datetime.now(UTC).isoformat(timespec="seconds")}


def _processor() -> str:
    """Return the processor's name from Linux, or else from Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return next(iter(names), "") or platform.processor() or "unknown"
