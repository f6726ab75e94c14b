"""A Modbus line: RTU over a serial port or Modbus TCP to a gateway, shared by several devices.

Modbus RTU does not number its requests: the answer to one may come late and be taken for the answer
to the next. So after any lost or wrong answer the device is suspect: before anything else is asked,
the line is left quiet for as long as an answer may take, and a block that is known to be there is
read with a count of registers that nothing else on the line asks for. Nothing is resent here but
what may safely be sent twice: reads, and a word that ends motion.
"""

from __future__ import annotations

import logging
import struct
import termios
import time
from collections.abc import Callable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, TypeVar

from pymodbus.exceptions import ModbusException, ModbusIOException

from drivers.lines.modbus_client import BusSettings, Client, client_for
from drivers.lines.priority_lock import PriorityLock
from drivers.lines.serial_line import Garbled, NoReply, PortGone
from instrument.closeable import Closing
from instrument.errors import DeviceError

if TYPE_CHECKING:
    from pymodbus.pdu import ModbusPDU

T = TypeVar("T")
Lost = (NoReply, Garbled, PortGone)  # after these nobody knows what the device has done

TRIES = 3
GIVES_UP_S = 1.5  # no exchange begins later than this after the first: an error within 2 s
MOST_LATE = 2  # earlier answers that may turn up one by one when the line is cleared
SILENCE_S = 0.00175  # between frames, above 19200 baud (Modbus over serial line, 2.5.1.1)
_SLICE_S = 0.02  # how long listening for quiet keeps the turn from a stop
_DIALOUT = (
    "look at the cable, at who else has the port open, at the parity, and whether you are in the "
    "group that may use it (dialout)"
)

log = logging.getLogger(__name__)
_GATEWAY = (
    "look at the gateway's power and its network cable, at its address in the rig file, and at who "
    "else is connected to it"
)
_READ, _WRITE_ONE, _WRITE = 3, 6, 16
_GATEWAY_SILENT = 0x0B
_MEANINGS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "the device failed to do it",
    6: "the device is busy",
    0x0A: "the gateway has no path to it",
    _GATEWAY_SILENT: "the device behind the gateway did not answer",
}


class ModbusBus(Closing):
    """An open line. One exchange at a time; a stop is let in first."""

    def __init__(self, who: str, settings: BusSettings) -> None:
        self.settings, self.port = settings, settings.port
        self.turns = PriorityLock()
        self._tcp = settings.port.startswith("tcp://")
        self._client = client_for(settings)
        self._gone, self._closed = "", False
        self._heard_s = time.monotonic()
        self.open(who)

    def close(self) -> None:
        """Let go of the port; safe twice."""
        self._closed = True
        self._let_go()

    def open(self, who: str) -> None:
        """Have the port open; a gateway that has hung up is called again.

        A lost serial port stays lost: another device may have got its name.
        """
        if self._closed or (self._gone and not self._tcp):
            raise self._lost(who, self._gone or "it was closed")
        try:
            self._client.connect()
        except (OSError, ValueError, termios.error) as error:
            look = _GATEWAY if self._tcp else _DIALOUT
            raise PortGone(f"{who}: cannot open {self.port}: {error}: {look}") from error

    def quiet_yet(self, who: str) -> bool:
        """Listen a moment; whether nothing has come for as long as an answer may take."""
        self.open(who)
        left_s = self._heard_s + self.settings.reply_s - time.monotonic()
        if left_s > 0 and self._guarded(who, lambda: self._client.listen(min(left_s, _SLICE_S))):
            self._heard_s = time.monotonic()
        return left_s <= 0

    def ask(self, who: str, action: Callable[[Client], T]) -> T:
        """One request and what came for it; whoever calls has the turn."""
        self.open(who)
        client, heard_s = self._client, self._heard_s
        if not self._tcp:
            time.sleep(max(0.0, heard_s + SILENCE_S - time.monotonic()))
        self._guarded(who, lambda: client.listen(0.0))  # what nobody asked for
        client.heard, client.deadline_s = b"", time.monotonic() + self.settings.reply_s
        try:
            return self._guarded(who, lambda: action(client))
        finally:
            self._heard_s = time.monotonic()

    def _guarded(self, who: str, action: Callable[[], T]) -> T:
        try:
            return action()
        except (ModbusIOException, struct.error, IndexError) as error:
            raise self._no_answer(who) from error
        except (ModbusException, OSError, ValueError, TypeError, AttributeError) as error:
            # ValueError and the two after it: closed under our hands, by another thread
            raise self._lost(who, str(error)) from error
        except termios.error as error:
            raise self._lost(who, str(error)) from error

    def _let_go(self) -> None:
        try:
            self._client.close()
        except (OSError, termios.error):
            return  # it is gone already: nothing is left to let go of

    def _no_answer(self, who: str) -> DeviceError:
        heard, within_s = self._client.heard, self.settings.reply_s
        if heard:
            return Garbled(
                f"{who}: no whole answer within {within_s:g} s, only {heard[:40].hex(' ')} hex: "
                f"look at the baud rate, the parity and the cable of {self.port}"
            )
        return NoReply(
            f"{who}: no answer within {within_s:g} s: look at its power, at its unit address and "
            f"at the cable of {self.port}"
        )

    def _lost(self, who: str, why: str) -> PortGone:
        self._gone = self._gone or why
        self._let_go()
        return PortGone(
            f"{who}: {self.port} is gone ({why}): look at its plug and its power, then go on"
        )


class ModbusUnit:
    """One device on a line: `unit` is its address, `known_register` begins a block it surely has.

    Nothing else may be asked of the device with one of `resync_counts` registers.
    """

    def __init__(
        self, bus: ModbusBus, who: str, unit: int, known_register: int, resync_counts: Sequence[int]
    ) -> None:
        self._bus, self._who, self._unit = bus, who, unit
        self._known, self._counts = known_register, cycle(resync_counts)
        self._why: DeviceError | None = None  # its last answer was lost or wrong
        self._suspect = True  # whoever had the line before may have left an answer on it

    @property
    def where(self) -> str:
        """Port and unit address."""
        return f"{self._bus.port}, unit {self._unit}"

    def read(self, register: int, count: int, until_s: float | None = None) -> list[int]:
        """`count` registers from `register` on; asked up to three times.

        No try begins after `until_s`, of the monotonic clock.
        """
        until = patience() if until_s is None else until_s
        for tries_left in reversed(range(TRIES)):
            try:
                return self._trusted(lambda: self._read(register, count), until)
            except Lost as lost:
                if not tries_left or time.monotonic() > until:
                    raise
                log.warning("%s", lost)
        raise NoReply(f"{self._who}: not asked")  # TRIES is not 0

    def write(
        self,
        register: int,
        values: Sequence[int],
        until_s: float,
        unless: Callable[[], None] = lambda: None,
    ) -> None:
        """Write registers, once. `unless` may raise, with the turn taken, and nothing is sent.

        After a lost answer (`Lost`) nobody knows whether it was executed: read it back.
        """

        def ask() -> None:
            unless()
            reply = self._ask(
                register,
                _WRITE,
                lambda c: c.write_registers(register, list(values), device_id=self._unit),
            )
            if (reply.address, reply.count) != (register, len(values)):
                raise self._garbled(f"register {reply.address:04X} hex, count {reply.count}")

        self._trusted(ask, until_s)

    def write_at_once(self, register: int, value: int) -> None:
        """Write one register before whatever waits for the line, even if the device is suspect.

        Only for what may be sent twice: it is, up to three times, until it is acknowledged.
        """
        for tries_left in reversed(range(TRIES)):
            try:
                with self._bus.turns.turn(urgent=True):
                    return self._write_one(register, value)
            except Lost as lost:
                if not tries_left:
                    raise
                log.warning("%s", lost)
        return None

    def _trusted(self, ask: Callable[[], T], until_s: float) -> T:
        """Ask once the line can be trusted; the turn is given back after every step."""
        late_ones = 0
        while True:
            with self._bus.turns.turn():
                if not self._suspect:
                    return ask()
                if time.monotonic() > until_s:
                    raise self._why or Garbled(
                        f"{self._who}: {self._bus.port} does not fall quiet: look at the cable, "
                        "and at what else is connected there"
                    )
                if not self._bus.quiet_yet(self._who):
                    continue
                try:
                    self._resync()
                except Garbled:  # an answer to something earlier: its own comes after it
                    late_ones += 1
                    if late_ones > MOST_LATE:
                        raise

    def _resync(self) -> None:
        """Whatever came before has come, once this answer has: its length tells it from others."""
        self._read(self._known, next(self._counts))
        self._suspect = False

    def _read(self, register: int, count: int) -> list[int]:
        reply = self._ask(
            register,
            _READ,
            lambda c: c.read_holding_registers(register, count=count, device_id=self._unit),
        )
        if len(reply.registers) != count:
            raise self._garbled(f"{len(reply.registers)} registers instead of {count}")
        return list(reply.registers)

    def _write_one(self, register: int, value: int) -> None:
        reply = self._ask(
            register,
            _WRITE_ONE,
            lambda c: c.write_register(register, value, device_id=self._unit),
        )
        if (reply.address, reply.registers) != (register, [value]):
            raise self._garbled(f"register {reply.address:04X} hex, {reply.registers}")

    def _ask(
        self,
        register: int,
        function: int,
        action: Callable[[Client], ModbusPDU],
    ) -> ModbusPDU:
        suspect, self._suspect = self._suspect, True
        try:
            reply = self._bus.ask(self._who, action)
        except Lost as lost:
            self._why = lost
            raise
        if reply.function_code & 0x7F != function:
            raise self._garbled(f"an answer to function {reply.function_code & 0x7F}")
        if reply.isError():
            self._refused(register, reply, suspect)
        self._suspect = suspect
        return reply

    def _refused(self, register: int, reply: ModbusPDU, suspect: bool) -> None:
        code = reply.exception_code
        text = (
            f"{self._who}: register {register:04X} hex at {self.where}: exception {code:02X} "
            f"({_MEANINGS.get(code, 'not known here')})"
        )
        if code == _GATEWAY_SILENT:
            self._why = NoReply(f"{text}: look at its power and at the cable behind the gateway")
            raise self._why
        self._suspect = suspect
        raise DeviceError(f"{text}: look at which device this is, and at its manual")

    def _garbled(self, what: str) -> Garbled:
        self._suspect = True
        self._why = wrong = Garbled(
            f"{self._who}: {self.where} answered something else than was asked: {what}: look at "
            "the cable, and for a second master on the line"
        )
        return wrong


def patience() -> float:
    """Until when, of the monotonic clock, an exchange may still begin."""
    return time.monotonic() + GIVES_UP_S
