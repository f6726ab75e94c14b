"""Signals that end the command at any moment: Ctrl-C, SIGTERM, SIGQUIT and a closed terminal.

While nothing has to be put in order the process ends at once, with one line and the exit code of
the operator's stop: an exception would come in the midst of an import, or of the interpreter's own
end. Inside an `orderly_end` block a signal raises `KeyboardInterrupt` instead.

Imported before all else, so it imports nothing heavy.
"""

from __future__ import annotations

import _thread
import atexit
import math
import os
import select
import signal
import sys
import time
from types import FrameType

from instrument.errors import OperatorStop

STOPPING_S = 2.0  # time allowed for stopping all devices
STOPS: dict[int, str] = {
    signal.SIGINT: "stopped by the operator",
    signal.SIGTERM: "stopped by the operator (SIGTERM)",
    signal.SIGQUIT: "stopped by the operator (SIGQUIT)",
    signal.SIGHUP: "stopped: the terminal was closed (SIGHUP)",
}
"""Signals that end the command, with the text of the event in the record."""
HEARD = 0
"""Byte for the stop thread: the main thread has seen the signal. No signal has this number."""
AGAIN = 128
"""Added to the number of a signal, for the stop thread: send it again, a little later."""
_WAKE = signal.SIGRTMIN  # ends a system call of the main thread, and means nothing else
_SHOW_CURSOR = "\x1b[?25h\n"  # DECTCEM of the VT220 (DEC): a progress display hides it


class _State:
    """State of this process, of which signals are a property."""

    def __init__(self) -> None:
        self.begun = False
        self.reason = ""  # of the last signal, empty before
        self.own_reason = ""  # for a signal that the program sends itself
        self.number: int = signal.SIGINT
        self.last_s = -math.inf
        self.orderly = 0  # `orderly_end` blocks that are open
        self.exit_code: int | None = None  # once the command has ended
        self.heard_fd = -1  # to the stop thread, if it runs


_state = _State()


def begin() -> None:
    """Let the signals end the command, from now on.

    A second signal within STOPPING_S is ignored, and a SIGHUP that was ignored before: `nohup`.
    They may be blocked until now: the program has restarted itself.
    """
    _state.reason, _state.last_s, _state.exit_code, _state.begun = "", -math.inf, None, True
    _state.own_reason = ""
    signal.signal(_WAKE, lambda *_: None)
    for number in STOPS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _on_signal)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)
    sys.unraisablehook = _on_unraisable
    atexit.register(_ignore)  # the first one is called last: Python's own end kills on a signal


def ended(exit_code: int) -> None:
    """Let a signal change nothing any more: the command is done, and so is its output.

    Python kills itself by a SIGINT in the end if a `KeyboardInterrupt` once left the code of a
    string, as a named tuple has, caught since or not; other such code makes it forget that (CPython
    3.11, run_eval_code_obj and exit_sigint).
    """
    exec("")
    _state.exit_code, _state.begun = exit_code, False


def stop(reason: str) -> None:
    """End the command as SIGTERM does, from any thread; `reason`: text for the record.

    Where its signals do not end the command, as in a notebook, it is interrupted as by Ctrl-C.
    """
    if _state.begun:
        _state.own_reason = reason
        os.kill(os.getpid(), signal.SIGTERM)
    else:
        _thread.interrupt_main()


def begun() -> bool:
    """Return True in a process whose signals end the command."""
    return _state.begun


def reason() -> str:
    """Return the text of the signal that has come, empty without one."""
    return _state.reason


def enter_orderly() -> None:
    """Have signals raise `KeyboardInterrupt` in the main thread, until `leave_orderly`.

    Another thread takes them, which has to call `wake_main_thread`: Linux gives a signal to the
    main thread first, where it would wait for a disk as long as that thread does.
    """
    _state.orderly += 1
    if _state.begun:
        signal.pthread_sigmask(signal.SIG_BLOCK, STOPS)


def leave_orderly() -> None:
    """End what `enter_orderly` has begun."""
    _state.orderly -= 1
    if _state.begun and not _state.orderly:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOPS)


def wake_main_thread(main: int) -> None:
    """Have the thread with this number handle a signal that another thread has taken."""
    signal.pthread_kill(main, _WAKE)


def report_to(descriptor: int) -> None:
    """Write HEARD to this descriptor whenever the main thread has seen a signal."""
    _state.heard_fd = descriptor


def end_at_once(text: str) -> None:
    """End the process with a line on standard error, and nothing else."""
    say(text)
    os._exit(OperatorStop.exit_code)


def say(text: str) -> None:
    """Write a line to standard error unless that would wait, or fails.

    Not through a stream: another thread may hold its lock.
    """
    poll = select.poll()
    poll.register(2, select.POLLOUT)
    try:
        if poll.poll(0):
            os.write(2, f"{_SHOW_CURSOR * os.isatty(2)}{text}\n".encode())
    except OSError:
        return


def _on_signal(number: int, frame: FrameType | None) -> None:
    now_s = time.monotonic()
    soon, _state.last_s = now_s - _state.last_s < STOPPING_S, now_s
    if _state.heard_fd >= 0:
        os.write(_state.heard_fd, bytes([HEARD]))
    if soon:
        return
    _state.reason, _state.number = _state.own_reason or STOPS[number], number
    if _state.exit_code is not None:
        os._exit(_state.exit_code)
    if not _state.orderly:
        end_at_once(_state.reason)
    if frame is not None and frame.f_code is _on_unraisable.__code__:
        _send_again()
        return
    raise KeyboardInterrupt(_state.reason)


def _on_unraisable(unraisable: sys.UnraisableHookArgs) -> None:
    """Send a signal again whose exception came where none can be raised, as in a destructor."""
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    _send_again()


def _send_again() -> None:
    _state.last_s = -math.inf
    os.write(_state.heard_fd, bytes([AGAIN | _state.number]))


def _ignore() -> None:
    for number in STOPS:
        signal.signal(number, signal.SIG_IGN)
