"""Rotary stages with Zaber's ASCII protocol, with checksums and message ids."""

from __future__ import annotations

import logging

from drivers.lines.serial_line import Garbled, Line, NoReply, number_of, repeated
from drivers.stages import zaber_framing as framing
from drivers.stages.motion import Limits, Status
from drivers.stages.motor_stage import MotorStage
from drivers.stages.zaber_framing import Reply
from instrument.clock import Clock
from instrument.errors import DeviceError

log = logging.getLogger(__name__)

_TRIES = 3
_QUIET_S = 0.05
_STOP_ID = framing.IDS - 1  # kept for stops, so that no query takes their replies


class Refused(DeviceError):
    """The device has rejected a command, and says why."""


class ZaberPort:
    """One axis of a device on a line that others may share.

    Each query has a number that its reply repeats, so a late reply is never taken for another's.
    Numbers repeat after 99 queries; therefore the line is drained while a reply is pending. After
    the port was gone, the device must report the serial number that it had before.

    A device adds a checksum to its replies only if its setting comm.checksum is 1. Without it a
    wrong digit would pass as a position, so it is switched on (`switched_on`) and then required.
    The device keeps the setting; the maker's own libraries read replies of both forms.
    """

    def __init__(self, line: Line, device: int, axis: int, who: str) -> None:
        self.line, self.device, self.axis, self.who = line, device, axis, who
        self._next_id, self._openings = 0, line.openings
        self.checked = self.switched_on = False
        self._require_checksums()
        self.serial = self.query("get system.serial", axis=0).data

    def _require_checksums(self) -> None:
        if not self.query("get deviceid", axis=0).checked:
            log.warning("%s: its replies carry no checksum: comm.checksum is set to 1", self.who)
            try:
                self.query("set comm.checksum 1", axis=0)
            except Refused as error:
                raise DeviceError(
                    f"{error}: its replies carry no checksum, so that a wrong digit would pass as "
                    "a position: set comm.checksum to 1 with the maker's program (Zaber Launcher)"
                ) from error
            self.switched_on = True
            if not self.query("get comm.checksum", axis=0).checked:
                raise DeviceError(
                    f"{self.who}: its replies carry no checksum although comm.checksum is 1: look "
                    "at what lies between it and the port"
                )
        self.checked = True

    def query(self, text: str, axis: int | None = None, tries: int = _TRIES) -> Reply:
        """Return the reply to a command that changes nothing and may be repeated."""
        return repeated(lambda: self.send(text, axis), tries)

    def send(self, text: str, axis: int | None = None) -> Reply:
        """Send a command, once; raise `DeviceError` with the reason if it is refused."""
        with self.line.lock.hold():
            self.line.recover()
            if self._openings != self.line.openings:
                self._require_same_device()
            reply = self._exchange(text, self.axis if axis is None else axis)
        if not reply.accepted:
            raise Refused(f"{self.who}: refused {text!r}: {reply.data}")
        return reply

    def _exchange(self, text: str, axis: int) -> Reply:
        if self.line.reply_pending:
            self.line.drain(_QUIET_S)
        self._next_id = number = (self._next_id + 1) % _STOP_ID
        request = framing.command(self.device, axis, number, text)
        return self.line.exchange(
            self.who, request, lambda line: self._own_reply(line, axis, number)
        )

    def _require_same_device(self) -> None:
        serial = self._exchange("get system.serial", 0).data
        if serial != self.serial:
            raise DeviceError(
                f"{self.who}: serial number {serial} answers now, and {self.serial} before: look "
                "at what is connected there"
            )
        self._openings = self.line.openings

    def stop(self, command: str = "stop") -> None:
        """Stop this axis, without the lock: the line is full duplex, and the reply is ignored."""
        self.line.write_at_once(framing.command(self.device, self.axis, _STOP_ID, command))

    def _own_reply(self, line: bytes, axis: int, number: int) -> Reply | None:
        reply = framing.reply_of(line, require_checksum=False)
        expected = (self.device, axis, number)
        if reply is None or (reply.device, reply.axis, reply.message_id) != expected:
            return None
        if self.checked and not reply.checked:
            raise Garbled(
                f"{self.who}: a reply without its checksum, {line[:40]!r}: if that stays, its "
                "comm.checksum is 0 again: start the program anew, which sets it"
            )
        return reply


class ZaberStage(MotorStage):
    """An axis of a Zaber device; an X-RSW60 has 1 536 000 microsteps per turn."""

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
        super().__init__(name, limits, clock, line, line.reply_s)
        self._who = f"{name} (Zaber, device {device} axis {axis} on {line.port})"
        self._port = ZaberPort(line, device, axis, self._who)
        self._steps_per_deg = microsteps_per_deg
        self._at_rest = False
        self._device_id = self._whole("deviceid", axis=0)
        self._range = self._angle("limit.min"), self._angle("limit.max")

    def identity(self) -> str:
        """Return device id, serial number and axis."""
        return f"Zaber device {self._device_id}, serial {self._port.serial}, axis {self._port.axis}"

    def status(self, retry: bool = True) -> Status:
        """Read position, motion and warnings, which come in one reply.

        The reply shows only the most urgent warning; "not homed" may be hidden behind it, so with
        any warning the whole list is read. It is not documented whether position and state are
        taken at the same instant. After the first reply that reports rest, both are read again:
        that position is one at rest.
        """
        tries = _TRIES if retry else 1
        reply = self._port.query("get pos", tries=tries)
        if not (self._at_rest or reply.busy):
            reply = self._port.query("get pos", tries=tries)
        self._at_rest = not reply.busy
        position = self._value(reply, "pos") / self._steps_per_deg
        flags = [reply.warning]
        if reply.warning != framing.NO_WARNING:
            flags = self._port.query("warnings", tries=tries).data.split()[1:]
        return Status(position, reply.busy, framing.homed(flags), framing.fault(flags))

    def _angle(self, setting: str) -> float:
        return self._value(self._port.query(f"get {setting}"), setting) / self._steps_per_deg

    def _whole(self, setting: str, axis: int | None = None) -> int:
        return int(self._value(self._port.query(f"get {setting}", axis), setting))

    def _value(self, reply: Reply, setting: str) -> float:
        value = number_of(reply.data)
        if value is None:
            raise Garbled(f"{self._who}: answers {setting} with {reply.data!r}; expected: a number")
        return value

    def _own_limits_deg(self) -> tuple[float, float]:
        return self._range

    def _own_settings(self) -> dict[str, str]:
        rate = self._whole("maxspeed") / framing.SPEED_PER_MICROSTEP
        ramp = self._whole("accel") / framing.ACCELERATION_PER_MICROSTEP
        by = " (set by this program)" if self._port.switched_on else ""
        return {
            "speed_deg_per_s": f"{rate / self._steps_per_deg:g}",
            "acceleration_deg_per_s2": f"{ramp / self._steps_per_deg:g}",
            "comm.checksum": f"1{by}",
        }

    def _send_home(self) -> None:
        self._send_motion("home")

    def _apply_speed(self) -> None:
        speed, ramp = self._limits.speed_deg_per_s, self._limits.acceleration_deg_per_s2
        self._set("maxspeed", speed, framing.SPEED_PER_MICROSTEP, "deg/s")
        self._set("accel", ramp, framing.ACCELERATION_PER_MICROSTEP, "deg/s2")

    def _set(self, setting: str, value: float, per_microstep: float, unit: str) -> None:
        """Set a speed or an acceleration, never to a higher one than asked for; read it back."""
        per_unit = self._steps_per_deg * per_microstep
        data = int(value * per_unit * (1 + 1e-9))
        advice = "put a value that the stage can do into the rig file"
        if data < 1:
            raise DeviceError(
                f"{self._who}: {setting} of {value:g} {unit} is less than the device's step of "
                f"{1 / per_unit:g} {unit}: {advice}"
            )
        try:
            self._port.send(f"set {setting} {data}")
        except Refused as error:
            raise DeviceError(f"{error} ({value:g} {unit}): {advice}") from error
        got = self._whole(setting)
        if got != data:
            raise DeviceError(
                f"{self._who}: {setting} is {got} after {data} was asked for ({value:g} {unit}): "
                f"{advice}"
            )

    def _send_move(self, angle_deg: float) -> None:
        steps = round(angle_deg * self._steps_per_deg)
        self._send_motion(f"move abs {steps}")

    def _send_motion(self, command: str) -> None:
        """Send a motion command; after a lost reply `MotorStage` decides by the stage's state."""
        self._at_rest = False
        try:
            self._port.send(command)
        except (NoReply, Garbled) as error:
            log.warning("%s", error)

    def _send_stop(self) -> None:
        self._port.stop()

    def _send_harder_stop(self) -> None:
        """End the motion without a ramp: estop, which public programs send; seen on no device."""
        self._port.stop("estop")
