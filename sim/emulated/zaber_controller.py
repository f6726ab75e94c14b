"""Emulated Zaber rotary stage (ASCII protocol): replies, checksums and warning flags.

Transcripts: replies have the form that the tests of the maker's MATLAB toolbox quote from devices
(`@01 0 OK IDLE -- 50001`); NI after a move that was stopped is from the example of the public
library zproto; the maker's library zaber-motion drives this stage in the tests. A reply carries a
checksum if the setting comm.checksum is 1, and not because the command had one: the maker's
libraries read both forms, and public programs set it. Not verified on a device: that last rule, the
value of deviceid (59999 is of no real device), the time of a reply (here none), and that estop,
which public programs send, ends a motion without a ramp.
"""

from __future__ import annotations

import re

from sim.emulated.motor import Motor

MICROSTEPS_PER_DEG = 1_536_000 / 360  # X-RSW60
_SPEED_PER_MICROSTEP = 1.6384
_ACCELERATION_PER_MICROSTEP = 1.6384e-4
_SETTABLE = {"maxspeed": range(1, 1 << 31), "accel": range(1, 1 << 31), "comm.checksum": range(2)}
_COMMAND = re.compile(r"/(\d+)?(?: (\d+))?(?: (\d\d))?(?: ([a-z].*))?")


class ZaberController:
    """One device with one axis. `motor.alarm` is a fault flag: it begins with F.

    `moves`: number of moves started.
    """

    def __init__(
        self, motor: Motor, device: int = 1, microsteps_per_deg: float = MICROSTEPS_PER_DEG
    ) -> None:
        self.motor, self.device, self._per_deg = motor, device, microsteps_per_deg
        self._buffer = b""
        self._interrupted = False
        self.moves = 0
        low, high = motor.mechanics.min_deg, motor.mechanics.max_deg
        speed = motor.mechanics.speed_deg_per_s * self._per_deg * _SPEED_PER_MICROSTEP
        acceleration = motor.mechanics.acceleration_deg_per_s2 * self._per_deg
        acceleration *= _ACCELERATION_PER_MICROSTEP
        self.settings: dict[str, int | str] = {
            "deviceid": 59999,  # of no real device
            "system.serial": 75001,
            "system.axiscount": 1,
            "system.access": 1,
            "version": "7.33",
            "version.build": 15000,
            "comm.protocol": 2,
            "comm.address": device,
            "comm.checksum": 0,
            "resolution": 64,
            "peripheral.id": 0,
            "limit.min": round(low * self._per_deg),
            "limit.max": round(high * self._per_deg),
            "maxspeed": round(speed),
            "accel": round(acceleration),
        }

    def answer(self, data: bytes) -> bytes:
        """Return the replies to all lines completed by these bytes."""
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        return b"".join(self._answer_line(line.strip()) for line in lines)

    def _answer_line(self, line: bytes) -> bytes:
        text, colon, check = line.decode("ascii", "replace").partition(":")
        found = _COMMAND.fullmatch(text)
        if found is None or (colon and check.upper() != f"{_checksum(text[1:]):02X}"):
            return b""  # no reply to a wrong checksum
        device, axis, number, words = found.groups()
        if device not in (None, "0", "00", str(self.device), f"{self.device:02d}"):
            return b""
        flag, data = self._execute((words or "").strip())
        return self._reply(axis or "0", number, flag, data)

    def _reply(self, axis: str, number: str | None, flag: str, data: str) -> bytes:
        """Reply with the state after the command: a move may have ended during it."""
        status = "BUSY" if self.motor.moving else "IDLE"
        head = f"{self.device:02d} {axis}" + (f" {number}" if number else "")
        body = f"{head} {flag} {status} {(self._warnings() or ['--'])[0]} {data}"
        check = f":{_checksum(body):02X}" if self.settings.get("comm.checksum") else ""
        return f"@{body}{check}\r\n".encode("ascii")

    def _execute(self, words: str) -> tuple[str, str]:
        """Execute a command; return OK or RJ, and the reply's data."""
        command, _, rest = words.partition(" ")
        if command == "":
            return "OK", "0"
        if command in ("stop", "estop"):
            self._interrupted |= self.motor.moving
            (self.motor.stop if command == "stop" else self.motor.halt)()
            return "OK", "0"
        if command == "warnings":
            flags = self._warnings()
            return "OK", " ".join([f"{len(flags):02d}", *flags])
        actions = {"get": self._get, "set": self._set, "move": self._move, "home": self._home}
        return actions[command](rest) if command in actions else ("RJ", "BADCOMMAND")

    def _get(self, setting: str) -> tuple[str, str]:
        if setting in ("pos", "encoder.pos"):
            return "OK", str(round(self.motor.position_deg * self._per_deg))
        if setting not in self.settings:
            return "RJ", "BADCOMMAND"
        return "OK", str(self.settings[setting])

    def _set(self, rest: str) -> tuple[str, str]:
        setting, _, value = rest.partition(" ")
        if setting not in _SETTABLE.keys() & self.settings.keys():
            return "RJ", "BADCOMMAND"
        if not value.isdigit() or int(value) not in _SETTABLE[setting]:
            return "RJ", "BADDATA"
        self.settings[setting] = int(value)
        self.motor.set_speed(
            int(self.settings["maxspeed"]) / _SPEED_PER_MICROSTEP / self._per_deg,
            int(self.settings["accel"]) / _ACCELERATION_PER_MICROSTEP / self._per_deg,
        )
        return "OK", "0"

    def _move(self, rest: str) -> tuple[str, str]:
        kind, _, value = rest.partition(" ")
        if kind != "abs" or not value.lstrip("-").isdigit():
            return "RJ", "BADDATA"
        if not self.motor.referenced:
            return "RJ", "BADCOMMAND"
        if self.motor.alarm:
            return "RJ", "DRIVERDISABLED"
        low, high = int(self.settings["limit.min"]), int(self.settings["limit.max"])
        if not low <= int(value) <= high:
            return "RJ", "BADDATA"
        self.moves += 1
        self._interrupted = False
        self.motor.move(int(value) / self._per_deg)
        return "OK", "0"

    def _home(self, _: str) -> tuple[str, str]:
        if self.motor.alarm:
            return "RJ", "DRIVERDISABLED"
        self._interrupted = False
        self.motor.home()
        return "OK", "0"

    def _warnings(self) -> list[str]:
        flags = [self.motor.alarm] if self.motor.alarm else []
        flags += [] if self.motor.referenced else ["WH"]
        return [*flags, "NI"] if self._interrupted else flags


def _checksum(body: str) -> int:
    return -sum(body.encode("ascii", "replace")) & 0xFF
