"""CPU time of a call, for ratios within one run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from statistics import mean, median

_MOST = 20  # calls of the other function beside one of the first


def cpu_seconds(action: Callable[[], object], repeats: int) -> float:
    """Least CPU time of one call: other load can only increase it."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)


def cpu_ratio(one: Callable[[], object], other: Callable[[], object], repeats: int) -> float:
    """Ratio of the CPU times of two functions, the median of calls that alternate.

    Each call of the one lies between about as long a time of the other, so that load, which slows
    the caches and the clock for seconds, tells on both alike.
    """
    ratios, others_s = list[float](), [cpu_seconds(other, 1)]
    for _ in range(repeats):
        one_s = cpu_seconds(one, 1)
        count = min(math.ceil(one_s / max(mean(others_s), 1e-9)), _MOST)
        after_s = [cpu_seconds(other, 1) for _ in range(count)]
        ratios.append(one_s / mean(others_s + after_s))
        others_s = after_s
    return median(ratios)
