"""Serial line with deadlines: bytes out, text lines in; errors name the port.

pyserial reports a lost port as `SerialException`, `OSError` or `termios.error`, depending on the
call. Here each of them becomes `PortGone`.
"""

from __future__ import annotations

import contextlib
import logging
import math
import re
import termios
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from drivers.lines.device_lock import unlock
from drivers.lines.priority_lock import PriorityLock
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.devices import REPLY_S
from instrument.errors import DeviceError

if TYPE_CHECKING:
    import serial

WRITE_S = 0.5  # pyserial also counts the time for which a busy computer suspends the process
HELD_S = 0.01  # 10 bytes at 9600 baud: a line that has sent none in that time is held
REOPEN_S, REOPEN_EVERY_S = 2.0, 0.05  # a stop waits so long for a port that has vanished
ECHO = "returns every request, as a two-wire RS-485 adapter may: the echo is skipped"
SLOW_LINE = ", or give a slow line more time (reply_s in the rig file)"
BY_ID = ", and name it by its link in /dev/serial/by-id"
MAX_LINE_BYTES = 1024  # anything longer is noise
_PORT_LOST = (OSError, ValueError, TypeError, termios.error)  # the last three: closed meanwhile
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")

log = logging.getLogger(__name__)

T = TypeVar("T")


class PortGone(DeviceError):
    """The port vanished or cannot be used: unplugged, in use, or not permitted."""


class PortClosed(PortGone):
    """The port was closed by this program."""


class NoReply(DeviceError):
    """The device did not answer in time."""


class Garbled(DeviceError):
    """The bytes received are not a valid answer to the question."""


def names_one_device(port: str) -> bool:
    """True for a link, as in /dev/serial/by-id, and for a network address.

    A numbered name goes to whichever device is plugged in next.
    """
    return "://" in port or Path(port).is_symlink()


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
    """An open serial port. `who` names the device behind it in messages.

    A port that was lost is opened again, by the same path, for a stop; for anything else only if
    the path is a link, such as those in /dev/serial/by-id, or a network address: a numbered name
    may by then belong to another device.
    """

    def __init__(
        self,
        who: str,
        port: str,
        baudrate: int,
        clock: Clock,
        xonxoff: bool = False,
        reply_s: float = REPLY_S,
    ) -> None:
        self.who, self.port, self.reply_s = who, port, reply_s
        self.lock = PriorityLock()
        self.reply_pending = False
        """True after a lost answer: the next bytes may answer an earlier question."""
        self.openings = 0
        """Number of times the port was opened: another one means that the plug was out."""
        self.echoes = False
        """True if the adapter returns each request, as a two-wire RS-485 adapter may."""
        self._baudrate, self._xonxoff, self._clock = baudrate, xonxoff, clock
        self._buffer = bytearray()
        self._serial: serial.Serial | None = None
        self._opening, self._closed = threading.Lock(), False
        self._follows_device = names_one_device(port)
        try:
            self._open()
        except _PORT_LOST as error:
            raise PortGone(
                f"{who}: cannot open {port}: {error}: look at the cable, at who else has the port "
                "open, and whether you are in the group that may use it (dialout)"
            ) from error

    def _open(self) -> None:
        import serial

        with self._opening:
            if self._serial is not None or self._closed:
                return
            self._serial = serial.serial_for_url(
                self.port, baudrate=self._baudrate, timeout=self.reply_s, write_timeout=WRITE_S,
                xonxoff=self._xonxoff, exclusive=True,
            )  # fmt: skip
            self._buffer.clear()
            self.openings, self.reply_pending = self.openings + 1, self.openings > 0

    def close(self) -> None:
        """Close the port; safe to call twice."""
        self._closed = True
        with self._opening:  # a stop that is just opening the port anew has finished
            port = self._serial
        self._release(port)

    def _release(self, port: serial.Serial | None) -> None:
        with self._opening:
            if port is None or port is not self._serial:
                return  # closed already, or opened anew by another thread
            self._serial = None
        with contextlib.suppress(OSError, termios.error):  # gone already
            unlock(port)
            port.close()

    def write(self, data: bytes) -> None:
        """Send bytes."""
        self._on_port(lambda port: self._write(port, data))

    def write_at_once(self, data: bytes) -> None:
        """Send a stop, once, ahead of everything; also over a port that was lost and is back.

        It waits for no answer, except on an adapter that echoes: there it would destroy one.
        """
        with self.lock.hold(urgent=True) if self.echoes else contextlib.nullcontext():
            self._open_again()
            self._on_port(self._free_output)
            self.write(data)
            if self.openings > 1 and not self._follows_device:
                self._on_port(lambda port: port.flush())
                self._release(self._serial)  # good for a stop only

    def _free_output(self, port: serial.Serial) -> None:
        """Discard bytes that the system holds back, so that a stop does not wait behind them.

        Bytes that are on their way are left alone: half a command would spoil the stop after it.
        """
        held = getattr(port, "out_waiting", 0)
        if held:
            self._clock.sleep(HELD_S)
            if port.out_waiting == held:
                port.reset_output_buffer()
        self._restart_output(port)

    def _restart_output(self, port: serial.Serial) -> None:
        """Go on sending although an XOFF has come: one byte of noise would hold the line for good.

        The system ends only a hold that the program has asked for itself.
        """
        if self._xonxoff and hasattr(port, "set_output_flow_control"):
            port.set_output_flow_control(False)
            port.set_output_flow_control(True)

    def _write(self, port: serial.Serial, data: bytes) -> None:
        import serial

        try:
            port.write(data)
        except serial.SerialTimeoutException as error:
            raise NoReply(
                f"{self.who}: {self.port} has not taken {data!r} within {WRITE_S:g} s: look at "
                "its cable and at what else runs on this computer"
            ) from error

    def read_line(self, deadline_s: float, who: str) -> bytes:
        """Return the next line without its end and without NUL bytes.

        `deadline_s` is a time of the line's clock; `NoReply` is raised when it has passed. A
        controller whose motor supply was cut sends NULs.
        """
        while (end := self._buffer.find(b"\n")) < 0:
            left_s = deadline_s - self._clock.now_s()
            if left_s <= 0 or len(self._buffer) > MAX_LINE_BYTES:
                raise self._no_line(who)
            self._buffer += self._read(left_s)
        if end > MAX_LINE_BYTES:
            raise self._no_line(who)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.replace(b"\0", b"").strip(b"\r")

    def exchange(self, who: str, request: bytes, parse: Callable[[bytes], T | None]) -> T:
        """Send a request and return the first result of `parse` that is not None.

        Lines for which `parse` returns None (alerts, late answers to other questions) are
        skipped, and so is the request itself, from an adapter that echoes. The caller holds the
        lock; errors name `who`.
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
            if line == request.strip():
                self._note_echo()
                continue
            answer = parse(line)
            if answer is not None:
                self.reply_pending = False
                return answer
            foreign = line or foreign

    def _note_echo(self) -> None:
        if not self.echoes:
            log.warning("%s: %s %s", self.who, self.port, ECHO)
        self.echoes = True

    def drain(self, quiet_s: float) -> bytes:
        """Discard input until the line has been quiet for `quiet_s`; return what was discarded.

        Raises `Garbled` for a device that sends without end.
        """
        self._on_port(self._restart_output)
        discarded, self._buffer = bytes(self._buffer), bytearray()
        last_s = self._clock.now_s()
        while self._clock.now_s() - last_s < quiet_s:
            more = self._read(quiet_s)
            if more:
                discarded, last_s = discarded + more, self._clock.now_s()
            if len(discarded) > 100 * MAX_LINE_BYTES:
                raise Garbled(
                    f"{self.who}: {self.port} sends without end, as {discarded[:40]!r}: look at "
                    "the baud rate and at what is connected there"
                )
        return discarded

    def _read(self, timeout_s: float) -> bytes:
        return self._on_port(lambda port: _read(port, timeout_s))

    def _no_line(self, who: str) -> DeviceError:
        if self._buffer:
            return self._garbled(who, bytes(self._buffer))
        return NoReply(
            f"{who}: no answer within {self.reply_s:g} s: look at its power and at the cable of "
            f"{self.port}{SLOW_LINE}"
        )

    def _garbled(self, who: str, received: bytes) -> Garbled:
        return Garbled(
            f"{who}: no valid answer within {self.reply_s:g} s, only {received[:40]!r}: look at "
            f"the baud rate and at the cable of {self.port}"
        )

    def recover(self) -> None:
        """Open a port again that was lost, if its path names one device; then verify which it is.

        Called before an exchange and never during one: a command must not reach a device that was
        not asked who it is.
        """
        if self._serial is None and self._follows_device:
            self._open_again()

    def _open_again(self) -> None:
        try:
            self._open()
        except _PORT_LOST as error:
            raise self._gone(str(error)) from error

    def _on_port(self, action: Callable[[serial.Serial], T]) -> T:
        port = self._serial
        if port is None:
            raise self._gone("it was lost")
        try:
            return action(port)
        except _PORT_LOST as error:
            self._release(port)
            raise self._gone(str(error)) from error

    def _gone(self, why: str) -> PortGone:
        if self._closed:
            return PortClosed(f"{self.who}: {self.port}: it was closed by this program")
        return PortGone(
            f"{self.who}: {self.port} is gone ({why}): look at its USB plug and its power"
            f"{'' if self._follows_device else BY_ID}, then go on"
        )


def _read(port: serial.Serial, timeout_s: float) -> bytes:
    port.timeout = timeout_s
    first = bytes(port.read(1))
    return first + bytes(port.read(port.in_waiting)) if first else b""
