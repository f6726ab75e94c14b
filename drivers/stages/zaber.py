"""Rotary stages that speak Zaber's ASCII protocol, with checksums and message ids."""

from __future__ import annotations

import logging
from collections.abc import Callable

from drivers.lines.serial_line import Garbled, Line, NoReply, number_of
from drivers.stages import zaber_framing as framing
from drivers.stages.motor_stage import Limits, MotorStage, Status
from drivers.stages.zaber_framing import Reply
from instrument.clock import Clock
from instrument.errors import DeviceError

BAUDRATE = 115200
log = logging.getLogger(__name__)

_TRIES = 3
_QUIET_S = 0.05
_STOP_ID = framing.IDS - 1  # kept for stops, so that their replies are nobody else's


class ZaberPort:
    """One axis of a device on a line that others may share.

    Every question has a number and the answer repeats it: a late one is never taken for another's.
    The number comes round after 99 questions, so a line on which an answer is owed is drained.
    """

    def __init__(self, line: Line, device: int, axis: int, who: str) -> None:
        self.line, self.device, self.axis, self.who = line, device, axis, who
        self._next_id = 0

    def ask(self, text: str, axis: int | None = None, tries: int = _TRIES) -> Reply:
        """The reply to a command that changes nothing; it may be asked again."""
        for _ in range(tries):
            try:
                return self.tell(text, axis)
            except (NoReply, Garbled) as error:
                log.warning("%s", error)
                last = error
        raise last

    def tell(self, text: str, axis: int | None = None) -> Reply:
        """Send a command, once. Raises `DeviceError` where it is refused, with the reason."""
        with self.line.turns.turn():
            if self.line.dirty:
                self.line.drain(_QUIET_S)
            self._next_id = (self._next_id + 1) % _STOP_ID
            number, to = self._next_id, self.axis if axis is None else axis
            request = framing.command(self.device, to, number, text)
            reply = self.line.exchange(self.who, request, lambda line: self._mine(line, to, number))
        if not reply.accepted:
            raise DeviceError(f"{self.who}: refused {text!r}: {reply.data}")
        return reply

    def stop(self) -> None:
        """Stop this axis, out of turn: the line carries both ways, and nobody awaits the reply."""
        self.line.write(framing.command(self.device, self.axis, _STOP_ID, "stop"))

    def _mine(self, line: bytes, axis: int, number: int) -> Reply | None:
        reply = framing.reply_of(line)
        asked = (self.device, axis, number)
        if reply is None or (reply.device, reply.axis, reply.message_id) != asked:
            return None
        return reply


class ZaberStage(MotorStage):
    """An axis of a Zaber device; an X-RSW60 has 1 536 000 microsteps a turn."""

    def __init__(
        self,
        name: str,
        line: Line,
        device: int,
        axis: int,
        microsteps_per_deg: float,
        limits: Limits,
        clock: Clock,
    ) -> None:
        super().__init__(name, limits, clock)
        self._who = f"{name} (Zaber, device {device} axis {axis} on {line.port})"
        self._port = ZaberPort(line, device, axis, self._who)
        self._steps_per_deg = microsteps_per_deg
        self._rests = False
        self._device_id = self._whole("deviceid", axis=0)
        self._serial = self._port.ask("get system.serial", axis=0).data
        self._range = self._angle("limit.min"), self._angle("limit.max")

    def identity(self) -> str:
        """Device id and serial number."""
        return f"Zaber device {self._device_id}, serial {self._serial}, axis {self._port.axis}"

    def status(self, patient: bool = True) -> Status:
        """Position, whether busy, and warnings, all in one reply.

        That reply shows the most urgent warning only; behind one there may be that it is not homed.
        Whether it takes position and state at one instant is not documented, so the first reply
        that says that the axis stands is asked for again: the position is then one of rest.
        """
        tries = _TRIES if patient else 1
        reply = self._port.ask("get pos", tries=tries)
        if not (self._rests or reply.busy):
            reply = self._port.ask("get pos", tries=tries)
        self._rests = not reply.busy
        position = self._value(reply, "pos") / self._steps_per_deg
        flags = [reply.warning]
        if reply.warning != framing.NO_WARNING:
            flags = self._port.ask("warnings", tries=tries).data.split()[1:]
        return Status(position, reply.busy, framing.homed(flags), framing.fault(flags))

    def close(self) -> None:
        """Let go of the line."""
        self._watchdog.end()
        self._port.line.close()

    def _angle(self, setting: str) -> float:
        return self._value(self._port.ask(f"get {setting}"), setting) / self._steps_per_deg

    def _whole(self, setting: str, axis: int | None = None) -> int:
        return int(self._value(self._port.ask(f"get {setting}", axis), setting))

    def _value(self, reply: Reply, setting: str) -> float:
        value = number_of(reply.data)
        if value is None:
            raise Garbled(f"{self._who}: answers {setting} with {reply.data!r}; expected: a number")
        return value

    def _own_limits_deg(self) -> tuple[float, float]:
        return self._range

    def _own_settings(self) -> dict[str, str]:
        rate = self._whole("maxspeed") / framing.SPEED_PER_MICROSTEP
        return {"speed_deg_per_s": f"{rate / self._steps_per_deg:g}"}

    def _send_home(self) -> None:
        self._sent(lambda: self._port.tell("home"))

    def _apply_speed(self) -> None:
        rate = self._limits.speed_deg_per_s * self._steps_per_deg
        wanted = round(rate * framing.SPEED_PER_MICROSTEP)
        self._port.tell(f"set maxspeed {wanted}")
        got = self._whole("maxspeed")
        if got != wanted:
            raise DeviceError(
                f"{self._who}: maxspeed is {got} after {wanted} was asked for "
                f"({self._limits.speed_deg_per_s:g} deg/s): put a speed that the stage can do into "
                "the rig file"
            )

    def _send_move(self, angle_deg: float) -> None:
        steps = round(angle_deg * self._steps_per_deg)
        self._sent(lambda: self._port.tell(f"move abs {steps}"))

    def _sent(self, action: Callable[[], object]) -> None:
        self._rests = False
        try:
            action()
        except (NoReply, Garbled) as error:
            log.warning("%s", error)
            return  # taken or not: the stage's own state tells, see MotorStage

    def _send_stop(self) -> None:
        self._port.stop()
