"""Threads that stop the axes at a signal, whatever the program is busy with: disk, fit or output.

Python runs the handler of a signal between two steps of the main thread, which may wait for a slow
disk for seconds. The number of the signal comes here at once, from the handler in C
(`signal.set_wakeup_fd`); each axis has a thread of its own, since a stop may wait for its line.
"""

from __future__ import annotations

import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache

from acquisition.terminal.stop_signals import (
    AGAIN,
    HEARD,
    STOPPING_S,
    STOPS,
    end_at_once,
    report_to,
    say,
    wake_main_thread,
)
from instrument.errors import DeviceError
from instrument.text.terminal_safe import escape_control_characters

_HUNG = (
    "The program waits for a disk or a device and cannot end. What is recorded is safe. Stop it "
    "once more to end it as it is: the lamp may stay lit"
)
_AGAIN_S = 0.01  # for the main thread to come to where an exception can be raised
_axes: list[_AxisThread] = []


class _AxisThread(threading.Thread):
    """Thread that calls `stop` of an axis each time it is told to."""

    def __init__(self, name: str, stop: Callable[[], None]) -> None:
        super().__init__(name=f"stop {name}", daemon=True)
        self.axis, self._stop_axis = name, stop
        self._told, self._over = threading.Event(), False
        self._failed, self._busy = "", False

    def run(self) -> None:
        while self._told.wait() and not self._over:
            self._told.clear()
            self._stop_once()

    def tell(self) -> None:
        """Have the axis stopped, once more if it is being stopped."""
        self._busy = True
        self._told.set()

    def end(self) -> None:
        """End the thread; a stop that has begun is given its time."""
        self._over = True
        self._told.set()
        self.join(STOPPING_S)

    def trouble(self) -> str:
        """Return why the axis may still move, empty if it was stopped."""
        return "its stop has not ended" if self._busy else self._failed

    def _stop_once(self) -> None:
        self._busy = True
        try:
            self._stop_axis()
            self._failed = ""
        except (DeviceError, OSError) as error:
            self._failed = str(error)
        self._busy = self._told.is_set()


@contextmanager
def stopped_by_signals(stops: Mapping[str, Callable[[], None]]) -> Iterator[None]:
    """Call these functions, which stop an axis each, at a signal within a `with` block."""
    threads = [_AxisThread(name, stop) for name, stop in stops.items()]
    for thread in threads:
        thread.start()
    _axes.extend(threads)
    try:
        yield
    finally:
        for thread in threads:
            _axes.remove(thread)
            thread.end()


@cache
def listen() -> None:
    """Start the thread that receives the signals, once in a process, from its main thread."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    report_to(writing)
    main = threading.get_ident()
    threading.Thread(target=_serve, args=(reading, main), name="stop", daemon=True).start()


def _serve(reading: int, main: int) -> None:
    """Stop the axes at each signal; speak for a main thread that does not see it in time."""
    poll, first, since_s = select.poll(), 0, 0.0
    poll.register(reading, select.POLLIN)
    while True:
        if first and not poll.poll(1e3 * STOPPING_S):
            say(_hung_text(first))
        for number in os.read(reading, 64):
            if number in STOPS:
                _stop_axes()
                wake_main_thread(main)
                if first and time.monotonic() - since_s > STOPPING_S:
                    end_at_once(f"{STOPS[number]}: the program hung and was ended")
                first, since_s = first or number, since_s if first else time.monotonic()
            elif number == HEARD:
                first = 0
            elif number & AGAIN:
                time.sleep(_AGAIN_S)
                os.kill(os.getpid(), number & ~AGAIN)


def _stop_axes() -> None:
    for axis in _axes:
        axis.tell()


def _hung_text(number: int) -> str:
    troubles = [f"LOOK AT THE RIG FIRST: {axis.axis}: {why}\n" for axis, why in _troubles()]
    motion = ": all motion has ended." if _axes and not troubles else "."
    return escape_control_characters(f"{''.join(troubles)}{STOPS[number]}{motion} {_HUNG}")


def _troubles() -> list[tuple[_AxisThread, str]]:
    return [(axis, axis.trouble()) for axis in _axes if axis.trouble()]
