"""Threads and descriptors of this process, counted before and after."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.support.timing.deadline import wait_for


def _threads() -> set[str]:
    return {f"{t.name} {t.ident}" for t in threading.enumerate()}


def open_descriptors() -> set[tuple[str, str]]:
    """Return the number and the target of each descriptor that this process has open."""
    found = set[tuple[str, str]]()
    for link in list(Path("/proc/self/fd").iterdir()):
        with suppress(FileNotFoundError):  # that of the list itself
            found.add((link.name, str(link.readlink())))
    return found


@contextmanager
def nothing_left_behind() -> Iterator[None]:
    """Fail if the block leaves a thread or an open descriptor behind.

    Those of before may go meanwhile: a closed emulated port keeps its number for a few seconds.
    """
    threads, descriptors = _threads(), open_descriptors()
    yield
    wait_for(lambda: _threads() <= threads, "end of all threads")
    assert open_descriptors() <= descriptors
