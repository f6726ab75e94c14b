"""Single keys in the terminal while a command runs, which a prompt interrupts.

The terminal hands over each key as it is pressed (mode "cbreak": signals such as that of Ctrl-C
stay), and is set back whenever a line has to be typed, and at the end.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

OnKey = Callable[[str], None]

_ESCAPE = b"\x1b"


class _Listening:
    """Thread that reads keys of a terminal until it is ended; the terminal is then as before."""

    def __init__(self, terminal: int, on_key: OnKey) -> None:
        self._terminal, self._on_key = terminal, on_key
        self._before = termios.tcgetattr(terminal)
        self._wake, self._woken = os.pipe()
        tty.setcbreak(terminal, termios.TCSANOW)
        self._thread = threading.Thread(target=self._run, name="keys", daemon=True)
        self._thread.start()

    def end(self) -> None:
        os.write(self._woken, b"0")
        self._thread.join()
        if _is_ours(self._terminal):  # to set that of another job would suspend this one
            with suppress(termios.error):  # it is gone
                termios.tcsetattr(self._terminal, termios.TCSANOW, self._before)
        os.close(self._wake)
        os.close(self._woken)

    def _run(self) -> None:
        both = [self._terminal, self._wake]
        while self._wake not in select.select(both, [], [])[0]:
            pressed = _read(self._terminal)
            if not pressed:
                return
            if not pressed.startswith(_ESCAPE):  # as the arrows and F1 do
                for key in pressed.decode("ascii", "replace"):
                    self._on_key(key)


def _read(terminal: int) -> bytes:
    """Return what was pressed, empty if the terminal is gone or belongs to another job by now."""
    try:
        return os.read(terminal, 64) if _is_ours(terminal) else b""
    except OSError:
        return b""


def _is_ours(terminal: int) -> bool:
    try:
        return os.isatty(terminal) and os.tcgetpgrp(terminal) == os.getpgrp()
    except OSError:  # not the terminal of this session
        return False


class _Keys:
    """Keys of this process: who hears them, and whether a line is being typed."""

    def __init__(self) -> None:
        self.on_key: OnKey | None = None
        self.listening: _Listening | None = None


_keys = _Keys()


@contextmanager
def keys_heard(on_key: OnKey) -> Iterator[bool]:
    """Call `on_key` with each key within a `with` block, from a thread.

    Yields False where there are none: standard input is no terminal, or that of another job.
    """
    _keys.on_key = on_key
    _begin()
    try:
        yield _keys.listening is not None
    finally:
        _keys.on_key = None
        _end()


@contextmanager
def line_typed() -> Iterator[None]:
    """Leave the terminal to a prompt within a `with` block."""
    _end()
    try:
        yield
    finally:
        _begin()


def _begin() -> None:
    try:
        terminal = sys.stdin.fileno()
    except (OSError, ValueError):  # closed, or replaced by a text
        return
    if _keys.on_key is not None and _is_ours(terminal):
        _keys.listening = _Listening(terminal, _keys.on_key)


def _end() -> None:
    listening, _keys.listening = _keys.listening, None
    if listening is not None:
        listening.end()
