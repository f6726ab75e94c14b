"""CPU time of a call, for ratios within one run."""

from __future__ import annotations

import time
from collections.abc import Callable


def cpu_seconds(action: Callable[[], object], repeats: int) -> float:
    """Least CPU time of one call: what else runs on the machine only adds to it."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)
