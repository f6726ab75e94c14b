"""Serial line with deadlines: bytes out, text lines in; errors name the port.

pyserial reports a lost port as `SerialException`, `OSError` or `termios.error`, depending on the
call. Here each of them becomes `PortGone`.
"""

from __future__ import annotations

import logging
import math
import re
import termios
from collections.abc import Callable
from typing import TypeVar

from drivers.lines.priority_lock import PriorityLock
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.errors import DeviceError

REPLY_S = 0.15  # controllers answer within 10 to 50 ms; a stop waits no longer than this, and a
# lost answer is asked for again before the status of a moving stage is too old
WRITE_S = 0.5  # pyserial also counts the time for which a busy computer suspends the process
MAX_LINE_BYTES = 1024  # anything longer is noise
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")

log = logging.getLogger(__name__)

A = TypeVar("A")
T = TypeVar("T")


class PortGone(DeviceError):
    """The port vanished or cannot be used: unplugged, in use, or not permitted."""


class NoReply(DeviceError):
    """The device did not answer in time."""


class Garbled(DeviceError):
    """The bytes received are not a valid answer to the question."""


def number_of(text: str) -> float | None:
    """Return a number written as `-12.5` or `1.2E-05`; None for anything else, nan and inf."""
    value = float(text) if _NUMBER.fullmatch(text) else math.inf
    return value if math.isfinite(value) else None


def repeated(question: Callable[[], T], tries: int) -> T:
    """Return the answer to a question that may be repeated, and is while its answer is lost."""
    while True:
        tries -= 1
        try:
            return question()
        except (NoReply, Garbled) as error:
            log.warning("%s", error)
            if not tries:
                raise


class Line(Closeable):
    """An open serial port. `who` names the device behind it in messages."""

    def __init__(
        self,
        who: str,
        port: str,
        baudrate: int,
        clock: Clock,
        xonxoff: bool = False,
        reply_s: float = REPLY_S,
    ) -> None:
        import serial

        self.who, self.port, self.reply_s = who, port, reply_s
        self.lock = PriorityLock()
        self.reply_pending = False
        """True after a lost answer: the next bytes may answer an earlier question."""
        self._clock = clock
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
        """Close the port; safe to call twice."""
        try:
            self._serial.close()
        except (OSError, termios.error):
            return  # the port is gone already

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._guarded(self._serial.write, data)

    def read_line(self, deadline_s: float, who: str) -> bytes:
        """Return the next line without its end and without NUL bytes.

        `deadline_s` is a time of the line's clock; `NoReply` is raised when it has passed. A
        controller whose motor supply was cut sends NULs.
        """
        while (end := self._buffer.find(b"\n")) < 0:
            left_s = deadline_s - self._clock.now_s()
            if left_s <= 0 or len(self._buffer) > MAX_LINE_BYTES:
                raise self._no_line(who)
            self._buffer += self._guarded(self._read, left_s)
        if end > MAX_LINE_BYTES:
            raise self._no_line(who)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.replace(b"\0", b"").strip(b"\r")

    def exchange(self, who: str, request: bytes, parse: Callable[[bytes], T | None]) -> T:
        """Send a request and return the first result of `parse` that is not None.

        Lines for which `parse` returns None (alerts, late answers to other questions) are
        skipped. The caller holds the lock; errors name `who`.
        """
        self.reply_pending = True
        self.write(request)
        deadline_s = self._clock.now_s() + self.reply_s
        foreign = b""
        while True:
            try:
                line = self.read_line(deadline_s, who)
            except NoReply:
                if foreign:
                    raise self._garbled(who, foreign) from None
                raise
            answer = parse(line)
            if answer is not None:
                self.reply_pending = False
                return answer
            foreign = line or foreign

    def drain(self, quiet_s: float) -> bytes:
        """Discard input until the line has been quiet for `quiet_s`; return what was discarded.

        Raises `Garbled` for a device that sends without end.
        """
        discarded, self._buffer = bytes(self._buffer), bytearray()
        last_s = self._clock.now_s()
        while self._clock.now_s() - last_s < quiet_s:
            more = self._guarded(self._read, quiet_s)
            if more:
                discarded, last_s = discarded + more, self._clock.now_s()
            if len(discarded) > 100 * MAX_LINE_BYTES:
                raise Garbled(
                    f"{self.who}: {self.port} sends without end, as {discarded[:40]!r}: look at "
                    "the baud rate and at what is connected there"
                )
        return discarded

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

    def _garbled(self, who: str, received: bytes) -> Garbled:
        return Garbled(
            f"{who}: no valid answer within {self.reply_s:g} s, only {received[:40]!r}: look at "
            f"the baud rate and at the cable of {self.port}"
        )

    def _guarded(self, action: Callable[[A], T], argument: A) -> T:
        try:
            return action(argument)
        except (OSError, TypeError, termios.error) as error:  # TypeError: closed meanwhile
            raise PortGone(
                f"{self.who}: {self.port} is gone ({error}): look at its USB plug and its power, "
                "then go on"
            ) from error
