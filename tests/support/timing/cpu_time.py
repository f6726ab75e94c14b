"""CPU time of a call, for ratios within one run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable


def cpu_seconds(action: Callable[[], object], repeats: int) -> float:
    """Least CPU time of one call: other load can only increase it."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)


def cpu_ratio(one: Callable[[], object], other: Callable[[], object], repeats: int) -> float:
    """Ratio of the least CPU times of two functions, called alternately."""
    least = [math.inf, math.inf]
    for _ in range(repeats):
        for n, action in enumerate((one, other)):
            least[n] = min(least[n], cpu_seconds(action, 1))
    return least[0] / least[1]
