"""Ctrl-C in the midst of a scan."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from unittest.mock import patch

from acquisition.plan.plan import Step
from acquisition.plan.step_count import StepCount
from tests.support.timing.deadline import wait_for


@contextmanager
def ctrl_c_after(steps: int) -> Iterator[None]:
    """Interrupt the scan in this process once so many steps are on disk.

    The main thread waits for the exception: the signal's handler may run in a destructor, which
    cannot raise, and the signal is sent again later then.
    """
    add, numbers = StepCount.add, count(1)

    def add_or_stop(counted: StepCount, step: Step) -> None:
        add(counted, step)
        if next(numbers) == steps:
            os.kill(os.getpid(), signal.SIGINT)
            wait_for(lambda: False, "the exception of the signal")

    with patch.object(StepCount, "add", add_or_stop):
        yield
