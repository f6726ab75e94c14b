"""A serial line: bytes out, lines in, each with a deadline; what goes wrong names the port.

pyserial's own behaviour on a lost port differs from call to call (`SerialException`, `OSError`,
`termios.error`): here all of it is `PortGone`.
"""

from __future__ import annotations

import math
import re
import termios
import time
from collections.abc import Callable
from typing import TypeVar

from drivers.lines.priority_lock import PriorityLock
from instrument.closeable import Closing
from instrument.errors import DeviceError

REPLY_S = 0.15  # controllers answer within 10 to 50 ms; a stop waits no longer than this, and an
# answer that was lost is had again before the status of a moving stage is too old
WRITE_S = 0.5  # pyserial counts the time that a busy computer takes it off the processor, too
MOST_BYTES = 1024  # of a line: what is longer is noise
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")

A = TypeVar("A")
T = TypeVar("T")


class PortGone(DeviceError):
    """The port vanished or cannot be used: unplugged, taken, forbidden."""


class NoReply(DeviceError):
    """The device did not answer in time."""


class Garbled(DeviceError):
    """What came is no answer to what was asked."""


def number_of(text: str) -> float | None:
    """A number as controllers write it, `-12.5` or `1.2E-05`; None for all else, nan and inf."""
    value = float(text) if _NUMBER.fullmatch(text) else math.inf
    return value if math.isfinite(value) else None


class Line(Closing):
    """An open serial port. `who` names the device behind it in messages."""

    def __init__(
        self,
        who: str,
        port: str,
        baudrate: int,
        xonxoff: bool = False,
        reply_s: float = REPLY_S,
    ) -> None:
        import serial

        self.who, self.port, self.reply_s = who, port, reply_s
        self.turns = PriorityLock()
        self.dirty = False
        """Whether an answer is still owed: what comes next may belong to an earlier question."""
        self._buffer = bytearray()
        try:
            self._serial = serial.serial_for_url(
                port, baudrate=baudrate, timeout=reply_s, write_timeout=WRITE_S,
                xonxoff=xonxoff, exclusive=True,
            )  # fmt: skip
        except (OSError, ValueError, termios.error) as error:
            raise PortGone(
                f"{who}: cannot open {port}: {error}: look at the cable, at who else has the port "
                "open, and whether you are in the group that may use it (dialout)"
            ) from error

    def close(self) -> None:
        """Let go of the port; safe twice."""
        try:
            self._serial.close()
        except (OSError, termios.error):
            return  # it is gone already: nothing is left to let go of

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._guarded(self._serial.write, data)

    def read_line(self, deadline_s: float, who: str) -> bytes:
        """The next line without its end, NUL bytes dropped; `NoReply` past the monotonic deadline.

        A controller whose motor supply was cut sends NULs.
        """
        while (end := self._buffer.find(b"\n")) < 0:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0 or len(self._buffer) > MOST_BYTES:
                raise self._no_line(who)
            self._buffer += self._guarded(self._read, left_s)
        if end > MOST_BYTES:
            raise self._no_line(who)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.replace(b"\0", b"").strip(b"\r")

    def exchange(self, who: str, request: bytes, pick: Callable[[bytes], T | None]) -> T:
        """Send a request and return what `pick` makes of its answer, the first that it takes.

        Other lines (an alert, a late answer to another question) are passed over. The caller has
        the turn; `who` asks, and is named in errors.
        """
        self.dirty = True
        self.write(request)
        deadline_s = time.monotonic() + self.reply_s
        foreign = b""
        while True:
            try:
                line = self.read_line(deadline_s, who)
            except NoReply:
                if foreign:
                    raise self._garbled(who, foreign) from None
                raise
            found = pick(line)
            if found is not None:
                self.dirty = False
                return found
            foreign = line or foreign

    def drain(self, quiet_s: float) -> bytes:
        """Throw away what comes until nothing has come for `quiet_s`; returns it.

        A device that never stops talking raises `Garbled`.
        """
        thrown, self._buffer = bytes(self._buffer), bytearray()
        last_s = time.monotonic()
        while time.monotonic() - last_s < quiet_s:
            more = self._guarded(self._read, quiet_s)
            if more:
                thrown, last_s = thrown + more, time.monotonic()
            if len(thrown) > 100 * MOST_BYTES:
                raise Garbled(
                    f"{self.who}: {self.port} sends without end, as {thrown[:40]!r}: look at the "
                    "baud rate and at what is connected there"
                )
        return thrown

    def _read(self, timeout_s: float) -> bytes:
        self._serial.timeout = timeout_s
        first = bytes(self._serial.read(1))
        return first + bytes(self._serial.read(self._serial.in_waiting)) if first else b""

    def _no_line(self, who: str) -> DeviceError:
        if self._buffer:
            return self._garbled(who, bytes(self._buffer))
        return NoReply(
            f"{who}: no answer within {self.reply_s:g} s: look at its power and at the cable "
            f"of {self.port}"
        )

    def _garbled(self, who: str, what: bytes) -> Garbled:
        return Garbled(
            f"{who}: no answer within {self.reply_s:g} s that makes sense, only "
            f"{what[:40]!r}: look at the baud rate and at the cable of {self.port}"
        )

    def _guarded(self, action: Callable[[A], T], argument: A) -> T:
        try:
            return action(argument)
        except (OSError, TypeError, termios.error) as error:  # TypeError: closed under our hands
            raise PortGone(
                f"{self.who}: {self.port} is gone ({error}): look at its USB plug and its power, "
                "then go on"
            ) from error
