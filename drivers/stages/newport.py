"""Rotary stages behind Newport's SMC100 or CONEX-CC controllers."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

from drivers.lines.serial_line import Garbled, Line, NoReply, repeated
from drivers.stages import newport_framing as framing
from drivers.stages.motion import Limits, Status
from drivers.stages.motor_stage import MotorStage
from instrument.clock import Clock
from instrument.errors import DeviceError

BAUDRATE = {"SMC100": 57600, "CONEX-CC": 921600}
# First words of the answer to VE. Two laboratories' notes quote "SMC_CC - Controller-driver version
# 3. 1. 2" of an SMC100CC and SMC_PP of the stepper version; several quote "CONEX-CC 2.0.1".
NAMES = {"SMC100": ("SMC_CC", "SMC_PP"), "CONEX-CC": ("CONEX-CC",)}
log = logging.getLogger(__name__)

_TRIES = 3
_QUIET_S = 0.1
_DEAF_S = 0.1  # ten public drivers wait 60 ms after a command, by trial and error

T = TypeVar("T")


class NewportPort:
    """One controller, by its address on a line that others may share.

    Answers carry no number, so one is trusted only on a clean line. After a time-out the input is
    drained, and the controller must report the same version as when it was opened; after the port
    was gone, also the same stage.

    A controller may hear nothing for a moment after a command. Whether it does shows the first time
    that its error code does not come.
    """

    def __init__(self, line: Line, address: int, who: str, clock: Clock) -> None:
        self.line, self.address, self.who, self._clock = line, address, who, clock
        self._deaf, self._error_may_be_old = False, True
        self.version, self.stage, self._openings = "", "", line.openings
        self.version = self.query("VE", str)

    def query(
        self, letters: str, parse: Callable[[str], T], value: str = "", tries: int = _TRIES
    ) -> T:
        """Return the parsed answer to a query; a query may be repeated."""

        def ask() -> T:
            with self.line.lock.hold():
                return self._query_once(letters, parse, value)

        return repeated(ask, tries)

    def send(self, letters: str, value: str | float = "") -> None:
        """Send a command, once, and ask for its error code.

        If that answer is lost, the command may or may not have been executed.
        """
        with self.line.lock.hold():
            self._clean()
            self._forget_error()
            try:
                self.line.write(framing.command(self.address, letters, value))
                self._clock.sleep(_DEAF_S if self._deaf else 0.0)
                letter = self._query_once("TE", str, "")
            except (NoReply, Garbled) as error:
                log.warning("%s; %s may or may not have been taken", error, letters)
                self._deaf = True
                return  # reading the error again would find it cleared
        if letter != "@":
            why = framing.ERRORS.get(letter[:1], "an error that this program does not know")
            raise DeviceError(
                f"{self.who}: refused {letters}{value}: {letter} {why}: nothing was begun"
            )

    def stop(self) -> None:
        """Stop this axis, without the lock: ST has no answer, and the line is full duplex.

        No harder one is known: whether MM0, which disables the motor, is accepted during a motion
        could not be verified, and a beam without current may fall.
        """
        self._error_may_be_old = True
        self.line.write_at_once(framing.command(self.address, "ST"))

    def _forget_error(self) -> None:
        """Read an error that is not of the next command: the controller keeps one until it is read.

        It may be from before the port was opened, or from a stop that arrived spoilt.
        """
        if self._error_may_be_old:
            self._error_may_be_old = False
            self._query_once("TE", str, "")

    def _query_once(self, letters: str, parse: Callable[[str], T], value: str) -> T:
        self._clean()
        text = self._exchange(letters, value)
        try:
            return parse(text)
        except Garbled:
            self.line.reply_pending = True
            raise

    def _exchange(self, letters: str, value: str = "") -> str:
        request = framing.command(self.address, letters, value)
        return self.line.exchange(
            self.who, request, lambda line: framing.answer_to(self.address, letters, line)
        )

    def _clean(self) -> None:
        """After a lost answer: drain the line, then verify the controller's version."""
        self.line.recover()
        if not self.line.reply_pending and self._openings == self.line.openings:
            return
        self.line.drain(_QUIET_S)
        if not self.version:  # while opening there is nothing yet to compare with
            self.line.reply_pending = False
            return
        self._require_same("VE", "", self.version)
        if self._openings != self.line.openings:
            self._require_same("ID", "?", self.stage)
            self._openings, self._error_may_be_old = self.line.openings, True

    def _require_same(self, letters: str, value: str, before: str) -> None:
        answer = self._exchange(letters, value)
        if answer != before:
            self.line.reply_pending = True
            raise Garbled(
                f"{self.who}: answers {letters} with {answer!r} now, and with {before!r} before: "
                "look at what is connected there"
            )


class NewportStage(MotorStage):
    """An axis of an SMC100 or a CONEX-CC; its unit must be degrees."""

    KEEPS_REFERENCE = True

    def __init__(
        self, name: str, line: Line, address: int, model: str, limits: Limits, clock: Clock
    ) -> None:
        super().__init__(name, limits, clock, line, line.reply_s)
        self._model = model
        self._who = f"{name} (Newport {model}, address {address} on {line.port})"
        self._port = NewportPort(line, address, self._who, clock)
        if not self._port.version.startswith(NAMES[model]):
            raise DeviceError(
                f"{self._who}: calls itself {self._port.version!r}; expected of a {model}: "
                f"{' or '.join(NAMES[model])}: look at port, address and model in the rig file"
            )
        self._port.stage = self._port.query("ID", str, "?")
        self._range = (self._setting("SL"), self._setting("SR"))

    def identity(self) -> str:
        """Return the model, the controller's version, the stage's name and the address."""
        port = self._port
        return f"Newport {self._model}: {port.version}, stage {port.stage}, address {port.address}"

    def status(self, retry: bool = True) -> Status:
        """Read state and errors, then the position."""
        tries = _TRIES if retry else 1
        state = self._port.query("TS", lambda text: framing.state(self._who, text), tries=tries)
        position = self._port.query("TP", self._number("TP"), tries=tries)
        return Status(position, state.moving, state.homed, state.fault)

    def _number(self, letters: str) -> Callable[[str], float]:
        return lambda text: framing.number(self._who, letters, text)

    def _setting(self, letters: str) -> float:
        return self._port.query(letters, self._number(letters), "?")

    def _own_limits_deg(self) -> tuple[float, float]:
        return self._range

    def _own_settings(self) -> dict[str, str]:
        names = {"speed_deg_per_s": "VA", "acceleration_deg_per_s2": "AC"}
        return {name: f"{self._setting(letters):g}" for name, letters in names.items()}

    def _send_home(self) -> None:
        self._port.send("OR")

    def _apply_speed(self) -> None:
        for letters, wanted in (
            ("VA", self._limits.speed_deg_per_s),
            ("AC", self._limits.acceleration_deg_per_s2),
        ):
            self._port.send(letters, wanted)
            got = self._setting(letters)
            if abs(got - wanted) > 1e-3 * wanted:
                raise DeviceError(
                    f"{self._who}: {letters} is {got:g} after {wanted:g} was asked for (deg/s, "
                    "deg/s2): put a value that the stage can do into the rig file"
                )

    def _send_move(self, angle_deg: float) -> None:
        self._port.send("PA", angle_deg)

    def _send_stop(self) -> None:
        self._port.stop()
