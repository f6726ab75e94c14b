"""Rotary stages behind Newport's SMC100 or CONEX-CC controllers."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

from drivers.lines.serial_line import Garbled, Line, NoReply
from drivers.stages import newport_framing as framing
from drivers.stages.motor_stage import Limits, MotorStage, Status
from instrument.clock import Clock
from instrument.errors import DeviceError

BAUDRATE = {"SMC100": 57600, "CONEX-CC": 921600}
log = logging.getLogger(__name__)

_TRIES = 3
_QUIET_S = 0.1

T = TypeVar("T")


class NewportPort:
    """One controller, by its address on a line that others may share.

    An answer is trusted only on a clean line: after any time-out what comes late is thrown away,
    and the version that was read at the opening must be read again.
    """

    def __init__(self, line: Line, address: int, who: str) -> None:
        self.line, self.address, self.who = line, address, who
        self._version = ""
        self._version = self.ask("VE", str)

    @property
    def version(self) -> str:
        """What the controller calls itself."""
        return self._version

    def ask(
        self, letters: str, read: Callable[[str], T], value: str = "", tries: int = _TRIES
    ) -> T:
        """The answer to a query; a query may be asked again."""
        for _ in range(tries):
            try:
                with self.line.turns.turn():
                    return self._ask_once(letters, read, value)
            except (NoReply, Garbled) as error:
                log.warning("%s", error)
                last = error
        raise last

    def tell(self, letters: str, value: str | float = "") -> None:
        """Send a command, once, and ask whether it was taken.

        A lost answer leaves that open; the stage's state has to tell then.
        """
        with self.line.turns.turn():
            self._clean()
            self.line.write(framing.command(self.address, letters, value))
            try:
                letter = self._ask_once("TE", str, "")
            except (NoReply, Garbled) as error:
                log.warning("%s; whether it took %s is open", error, letters)
                return  # reading the error again would find it cleared
        if letter != "@":
            why = framing.ERRORS.get(letter[:1], "an error that this program does not know")
            raise DeviceError(
                f"{self.who}: refused {letters}{value}: {letter} {why}: nothing was begun"
            )

    def stop(self) -> None:
        """Stop this axis. Needs no turn: ST is not answered, and the line carries both ways."""
        self.line.write(framing.command(self.address, "ST"))

    def _ask_once(self, letters: str, read: Callable[[str], T], value: str) -> T:
        self._clean()
        request = framing.command(self.address, letters, value)
        text = self.line.exchange(
            self.who, request, lambda line: framing.answer_to(self.address, letters, line)
        )
        try:
            return read(text)
        except Garbled:
            self.line.dirty = True
            raise

    def _clean(self) -> None:
        """Throw away what is late; then the controller must give its name again."""
        if not self.line.dirty:
            return
        self.line.drain(_QUIET_S)
        if not self._version:  # at the opening there is nothing yet to compare with
            self.line.dirty = False
            return
        request = framing.command(self.address, "VE")
        name = self.line.exchange(
            self.who, request, lambda li: framing.answer_to(self.address, "VE", li)
        )
        if name != self._version:
            self.line.dirty = True
            raise Garbled(f"{self.who}: calls itself {name!r} now, and {self._version!r} before")


class NewportStage(MotorStage):
    """An axis of an SMC100 or a CONEX-CC; its unit must be degrees."""

    KEEPS_REFERENCE = True

    def __init__(
        self, name: str, line: Line, address: int, model: str, limits: Limits, clock: Clock
    ) -> None:
        super().__init__(name, limits, clock)
        self._who = f"{name} (Newport {model}, address {address} on {line.port})"
        self._port = NewportPort(line, address, self._who)
        if model not in self._port.version:
            raise DeviceError(
                f"{self._who}: calls itself {self._port.version!r}; expected: a {model}: look at "
                "the port and the address in the rig file"
            )
        self._stage = self._port.ask("ID", str, "?")
        self._range = (
            self._port.ask("SL", self._number("SL"), "?"),
            self._port.ask("SR", self._number("SR"), "?"),
        )

    def identity(self) -> str:
        """Version of the controller, name of the stage."""
        return f"Newport {self._port.version}, stage {self._stage}, address {self._port.address}"

    def status(self, patient: bool = True) -> Status:
        """Position, state, errors."""
        tries = _TRIES if patient else 1
        state = self._port.ask("TS", lambda text: framing.state(self._who, text), tries=tries)
        position = self._port.ask("TP", self._number("TP"), tries=tries)
        return Status(position, state.moving, state.homed, state.fault)

    def close(self) -> None:
        """Let go of the line."""
        self._watchdog.end()
        self._port.line.close()

    def _number(self, letters: str) -> Callable[[str], float]:
        return lambda text: framing.number(self._who, letters, text)

    def _own_limits_deg(self) -> tuple[float, float]:
        return self._range

    def _own_settings(self) -> dict[str, str]:
        asked = {"speed_deg_per_s": "VA", "acceleration_deg_per_s2": "AC"}
        found = {n: self._port.ask(way, self._number(way), "?") for n, way in asked.items()}
        return {name: f"{value:g}" for name, value in found.items()}

    def _send_home(self) -> None:
        self._port.tell("OR")

    def _apply_speed(self) -> None:
        for letters, wanted in (
            ("VA", self._limits.speed_deg_per_s),
            ("AC", self._limits.acceleration_deg_per_s2),
        ):
            self._port.tell(letters, wanted)
            got = self._port.ask(letters, self._number(letters), "?")
            if abs(got - wanted) > 1e-3 * wanted:
                raise DeviceError(
                    f"{self._who}: {letters} is {got:g} after {wanted:g} was asked for (deg/s, "
                    "deg/s2): put a value that the stage can do into the rig file"
                )

    def _send_move(self, angle_deg: float) -> None:
        self._port.tell("PA", angle_deg)

    def _send_stop(self) -> None:
        self._port.stop()
