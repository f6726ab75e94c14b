"""CPU time of a call, together with the value that it returned, so that both can be checked."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Generic, NamedTuple, TypeVar

Value = TypeVar("Value")

_TICK_S = 1e-9  # of the clock
_RUN_S = 2e-3  # least duration of one timing
_LONG_S = 1.0  # total after which two timings are enough


class Timed(NamedTuple, Generic[Value]):
    """Least and median CPU seconds of one call, and the value of the last call.

    Other load on the machine only adds to a time, so the least one is nearest to the truth.
    """

    least_s: float
    median_s: float
    value: Value

    @property
    def spread(self) -> float:
        """Median over least time, minus 1."""
        return self.median_s / self.least_s - 1


def timed(
    action: Callable[[], Value], repeats: int, before: Callable[[], object] | None = None
) -> Timed[Value]:
    """Time a call `repeats` times (3 or more), a long one twice; `before` runs first, untimed.

    The first call, with its imports and new memory, does not count. A call too short for the clock
    is run several times in a row, unless `before` has to precede each. Raises `ValueError` for
    fewer repeats.
    """
    if repeats < 3:
        raise ValueError(f"repeats = {repeats}; allowed: 3 or more")
    value, once_s = _once(action, before)
    in_a_row = 1
    if before is None and once_s < _RUN_S:
        in_a_row = max(1, round(_RUN_S / max(_once(action, before)[1], _TICK_S)))
    times: list[float] = []
    while len(times) < 2 or (len(times) < repeats and sum(times) * in_a_row < _LONG_S):
        value, taken_s = _once(action, before, in_a_row)
        times.append(taken_s / in_a_row)
    return Timed(max(min(times), _TICK_S), max(median(times), _TICK_S), value)


def _once(
    action: Callable[[], Value], before: Callable[[], object] | None, in_a_row: int = 1
) -> tuple[Value, float]:
    """Return the value of the last of some calls in a row, and the CPU seconds of all."""
    if before is not None:
        before()
    begun_s = time.process_time()
    for _ in range(in_a_row - 1):
        action()
    value = action()
    return value, time.process_time() - begun_s
