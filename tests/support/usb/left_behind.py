"""Threads and descriptors of this process, counted before and after."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.timing.deadline import wait_for


def _held() -> tuple[set[str], int]:
    names = {f"{t.name} {t.ident}" for t in threading.enumerate()}
    return names, len(list(Path("/proc/self/fd").iterdir()))


@contextmanager
def nothing_left_behind() -> Iterator[None]:
    """Fail if the block leaves a thread or an open descriptor behind."""
    threads, descriptors = _held()
    yield
    wait_for(lambda: _held()[0] <= threads, "end of all threads")
    assert _held()[1] == descriptors
