"""Modbus line shared by several devices: RTU over a serial port, or Modbus TCP to a gateway.

Modbus RTU does not number its requests, so a late answer could be taken for the answer to the next
request. After any lost or wrong answer the device counts as out of step. Before the next request
the line is left quiet for as long as an answer may take. Then a block that is known to exist is
read with a register count that no other request on this line uses. Only reads, and a word that
ends motion, are ever sent twice.
"""

from __future__ import annotations

import logging
import struct
import termios
from collections.abc import Callable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, TypeVar

from pymodbus.exceptions import ModbusException, ModbusIOException

from drivers.lines.modbus_client import BusSettings, Client, client_for
from drivers.lines.priority_lock import PriorityLock
from drivers.lines.serial_line import (
    BY_ID,
    SLOW_LINE,
    Garbled,
    NoReply,
    PortClosed,
    PortGone,
    names_one_device,
)
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.errors import DeviceError

if TYPE_CHECKING:
    from pymodbus.pdu import ModbusPDU

T = TypeVar("T")
AnswerLost = (NoReply, Garbled, PortGone)  # the device may or may not have executed the request

TRIES = 3
GIVE_UP_S = 1.5  # no exchange begins later than this after the first: an error within 2 s
GIVE_UP_ANSWERS = 6  # on a slow line: the time allowed for so many answers
MAX_LATE_ANSWERS = 2  # earlier answers that may arrive one by one while resynchronising
SILENCE_S = 0.00175  # between frames, above 19200 baud (Modbus over serial line, 2.5.1.1)
# ValueError, TypeError, AttributeError: another thread has closed the port meanwhile.
_CONNECTION_LOST = (
    ModbusException, OSError, termios.error, ValueError, TypeError, AttributeError,
)  # fmt: skip
_SLICE_S = 0.02  # listening for quiet delays a stop by no more than this
_CHECK_PORT = (
    "look at the cable, at who else has the port open, at the parity, and whether you are in the "
    "group that may use it (dialout)"
)
_CHECK_GATEWAY = (
    "look at the gateway's power and its network cable, at its address in the rig file, and at who "
    "else is connected to it"
)
_READ, _WRITE_ONE, _WRITE = 3, 6, 16
_GATEWAY_SILENT = 0x0B
_EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "the device failed to do it",
    6: "the device is busy",
    0x0A: "the gateway has no path to it",
    _GATEWAY_SILENT: "the device behind the gateway did not answer",
}

log = logging.getLogger(__name__)


class ModbusBus(Closeable):
    """An open line: one exchange at a time, urgent ones first.

    `losses`: number of times the port was lost.
    """

    def __init__(self, who: str, settings: BusSettings, clock: Clock) -> None:
        self.settings, self.port, self.clock = settings, settings.port, clock
        self.lock = PriorityLock()
        self._tcp = settings.port.startswith("tcp://")
        self._client = client_for(settings, clock)
        self._gone, self._closed = "", False
        self._follows_device, self.losses = names_one_device(self.port), 0
        self._active_s = clock.now_s()
        self.open(who)

    def close(self) -> None:
        """Close the port; safe to call twice."""
        self._closed = True
        self._close_client()

    def open(self, who: str, at_any_path: bool = False) -> None:
        """Open the port unless it is open; one that was lost, if its path names one device.

        A numbered name may belong to another device by then: it is opened again for a stop only.
        """
        self._require_open(who)
        if self._gone and not (self._follows_device or at_any_path):
            raise self._port_gone(who, self._gone)
        try:
            self._client.connect()
            self._gone = "" if self._follows_device else self._gone
        except (OSError, ValueError, termios.error) as error:
            if self.losses and not self._tcp:
                raise self._port_gone(who, str(error)) from error
            look = _CHECK_GATEWAY if self._tcp else _CHECK_PORT
            raise PortGone(f"{who}: cannot open {self.port}: {error}: {look}") from error
        if self._closed:  # by another thread, while it was being opened
            self._close_client()
        self._require_open(who)

    def _require_open(self, who: str) -> None:
        if self._closed:
            raise PortClosed(f"{who}: {self.port}: it was closed by this program")

    def release_foreign(self) -> None:
        """Close a port that was opened again for a stop, and may belong to another device."""
        if self._gone:
            self._close_client()

    def listen_for_quiet(self, who: str) -> bool:
        """Listen briefly; True once the line has been quiet for as long as an answer may take."""
        self.open(who)
        left_s = self._active_s + self.settings.reply_s - self.clock.now_s()
        if left_s > 0 and self._guarded(who, lambda: self._client.listen(min(left_s, _SLICE_S))):
            self._active_s = self.clock.now_s()
        return left_s <= 0

    def exchange(self, who: str, action: Callable[[Client], T], a_stop: bool = False) -> T:
        """Send one request and return its answer; the caller holds the lock."""
        self.open(who, at_any_path=a_stop)
        client, active_s = self._client, self._active_s
        if not self._tcp:
            self.clock.sleep(active_s + SILENCE_S - self.clock.now_s())
        self._guarded(who, lambda: client.listen(0.0))  # discard unsolicited bytes
        client.received, client.deadline_s = b"", self.clock.now_s() + self.settings.reply_s
        try:
            return self._guarded(who, lambda: action(client))
        finally:
            self._active_s = self.clock.now_s()

    def _guarded(self, who: str, action: Callable[[], T]) -> T:
        try:
            return action()
        except (ModbusIOException, struct.error, IndexError) as error:
            raise self._no_answer(who) from error
        except _CONNECTION_LOST as error:
            raise self._lost(who, str(error)) from error

    def _close_client(self) -> None:
        try:
            self._client.close()
        except (OSError, termios.error):
            return  # the port is gone already

    def _no_answer(self, who: str) -> DeviceError:
        received, within_s = self._client.received, self.settings.reply_s
        if received and received == getattr(self._client, "sent", b""):
            return NoReply(
                f"{who}: no answer within {within_s:g} s, only the echo of the request: look at "
                f"its power, at its unit address and at the cable behind the adapter of {self.port}"
            )
        if received:
            return Garbled(
                f"{who}: no whole answer within {within_s:g} s, only {received[:40].hex(' ')} hex: "
                f"look at the baud rate, the parity and the cable of {self.port}"
            )
        return NoReply(
            f"{who}: no answer within {within_s:g} s: look at its power, at its unit address and "
            f"at the cable of {self.port}{SLOW_LINE}"
        )

    def _lost(self, who: str, why: str) -> PortGone:
        self._gone, self.losses = self._gone or why, self.losses + 1
        self._close_client()
        return self._port_gone(who, why)

    def _port_gone(self, who: str, why: str) -> PortGone:
        return PortGone(
            f"{who}: {self.port} is gone ({why}): look at its plug and its power"
            f"{'' if self._follows_device else BY_ID}, then go on"
        )


class ModbusUnit:
    """One device on a line, at the address `unit`.

    `known_register` begins a block of registers that the device certainly has. `resync_counts` are
    register counts reserved for resynchronising: no other request to the device may use them.
    """

    def __init__(
        self, bus: ModbusBus, who: str, unit: int, known_register: int, resync_counts: Sequence[int]
    ) -> None:
        self._bus, self._who, self._unit = bus, who, unit
        self.where = f"{bus.port}, unit {unit}"
        self._known, self._counts = known_register, cycle(resync_counts)
        self._last_error: DeviceError | None = None
        self._losses = bus.losses
        self._out_of_step = True  # an earlier user of the line may have left an answer on it

    def deadline_s(self) -> float:
        """Return the time of the bus's clock until which an exchange may still begin."""
        reply_s = self._bus.settings.reply_s
        return self._bus.clock.now_s() + max(GIVE_UP_S, GIVE_UP_ANSWERS * reply_s)

    def read(self, register: int, count: int, until_s: float | None = None) -> list[int]:
        """Return `count` registers from `register` on; up to three tries, none after `until_s`."""
        until = self.deadline_s() if until_s is None else until_s
        return self._retried(
            lambda: self._in_step(lambda: self._read(register, count), until), until
        )

    def write(
        self,
        register: int,
        values: Sequence[int],
        until_s: float,
        check: Callable[[], None] = lambda: None,
    ) -> None:
        """Write registers, once. If `check`, called with the lock held, raises, nothing is sent.

        After a lost answer (`AnswerLost`) the values may or may not have been taken: read them
        back.
        """

        def send() -> None:
            check()
            reply = self._exchange(
                register,
                _WRITE,
                lambda c: c.write_registers(register, list(values), device_id=self._unit),
            )
            if (reply.address, reply.count) != (register, len(values)):
                raise self._garbled(f"register {reply.address:04X} hex, count {reply.count}")

        self._in_step(send, until_s)

    def write_at_once(self, register: int, value: int) -> None:
        """Write one register, once, before all queued exchanges, even if out of step.

        Also over a port that was lost and is back: only for what is safe to repeat. Raises
        `AnswerLost` if it is not acknowledged.
        """
        with self._bus.lock.hold(urgent=True):
            self._write_one(register, value)
            self._bus.release_foreign()

    def _in_step(self, action: Callable[[], T], until_s: float) -> T:
        """Resynchronise if necessary, then act; the lock is released after every step."""
        late_answers = 0
        while True:
            with self._bus.lock.hold():
                if self._losses != self._bus.losses:
                    self._losses, self._out_of_step = self._bus.losses, True
                if not self._out_of_step:
                    return action()
                if self._bus.clock.now_s() > until_s:
                    raise self._last_error or Garbled(
                        f"{self._who}: {self._bus.port} does not fall quiet: look at the cable, "
                        "and at what else is connected there"
                    )
                if not self._bus.listen_for_quiet(self._who):
                    continue
                try:
                    self._resynchronise()
                except Garbled:  # an answer to an earlier request: its own comes after it
                    late_answers += 1
                    if late_answers > MAX_LATE_ANSWERS:
                        raise

    def _resynchronise(self) -> None:
        """Read a block of unique length: after its answer, no earlier one can still come."""
        self._read(self._known, next(self._counts))
        self._out_of_step = False

    def _read(self, register: int, count: int) -> list[int]:
        reply = self._exchange(
            register,
            _READ,
            lambda c: c.read_holding_registers(register, count=count, device_id=self._unit),
        )
        if len(reply.registers) != count:
            raise self._garbled(f"{len(reply.registers)} registers instead of {count}")
        return list(reply.registers)

    def _write_one(self, register: int, value: int) -> None:
        reply = self._exchange(
            register,
            _WRITE_ONE,
            lambda c: c.write_register(register, value, device_id=self._unit),
            a_stop=True,
        )
        if (reply.address, reply.registers) != (register, [value]):
            raise self._garbled(f"register {reply.address:04X} hex, {reply.registers}")

    def _retried(self, action: Callable[[], T], until_s: float) -> T:
        """Return the result of up to three tries, none of them begun after `until_s`."""
        for tries_left in reversed(range(TRIES)):
            try:
                return action()
            except AnswerLost as lost:
                if not tries_left or self._bus.clock.now_s() > until_s:
                    raise
                log.warning("%s", lost)
        raise NoReply(f"{self._who}: not asked")  # TRIES is not 0

    def _exchange(
        self,
        register: int,
        function: int,
        action: Callable[[Client], ModbusPDU],
        a_stop: bool = False,
    ) -> ModbusPDU:
        out_of_step, self._out_of_step = self._out_of_step, True
        try:
            reply = self._bus.exchange(self._who, action, a_stop)
        except AnswerLost as lost:
            self._last_error = lost
            raise
        if reply.function_code & 0x7F != function:
            raise self._garbled(f"an answer to function {reply.function_code & 0x7F}")
        if reply.isError():
            self._raise_refusal(register, reply, out_of_step)
        self._out_of_step = out_of_step
        return reply

    def _raise_refusal(self, register: int, reply: ModbusPDU, out_of_step: bool) -> None:
        code = reply.exception_code
        text = (
            f"{self._who}: register {register:04X} hex at {self.where}: exception {code:02X} "
            f"({_EXCEPTIONS.get(code, 'not known here')})"
        )
        if code == _GATEWAY_SILENT:
            self._last_error = NoReply(
                f"{text}: look at its power and at the cable behind the gateway"
            )
            raise self._last_error
        self._out_of_step = out_of_step
        raise DeviceError(f"{text}: look at which device this is, and at its manual")

    def _garbled(self, what: str) -> Garbled:
        self._out_of_step = True
        self._last_error = error = Garbled(
            f"{self._who}: {self.where} answered something else than was asked: {what}: look at "
            "the cable, and for a second master on the line"
        )
        return error
