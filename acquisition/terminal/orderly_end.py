"""Blocks that a signal ends with an exception, since something has to be put in order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from acquisition.terminal.stop_signals import begun, enter_orderly, leave_orderly, reason
from acquisition.terminal.stop_thread import listen
from instrument.errors import OperatorStop


@contextmanager
def orderly_end() -> Iterator[None]:
    """Have a signal raise `KeyboardInterrupt` within a `with` block.

    So does an error that follows a signal: a library may turn the interruption into an error of its
    own, and an axis that was stopped from another thread says that it was.
    """
    if begun():
        listen()  # before the signals are blocked here: its thread takes them
    enter_orderly()
    try:
        yield
    except OperatorStop:
        raise
    except Exception as error:
        if not reason():
            raise
        raise KeyboardInterrupt(reason()) from error
    finally:
        leave_orderly()
