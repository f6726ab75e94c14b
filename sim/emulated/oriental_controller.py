"""An Oriental Motor AZ drive as its line sees it: Modbus RTU bytes in, bytes out.

Framing and registers are written here a second time, from the maker's manual and the Modbus
specification, and share nothing with the driver's: one mistake cannot hide in both.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from sim.emulated.motor import Motor

GAP_S = 0.05  # what comes later than this after the last byte begins a new frame
OVERLOAD_S = 5.0  # pushing for so long without getting on is an overload

_DIRECT, _INPUT, _OUTPUT, _ALARM = 0x58, 0x7C, 0x7E, 0x80
_COMMAND_POSITION, _FEEDBACK_POSITION, _ALARM_RESET = 0xC6, 0xCC, 0x180
_TRIGGER = _DIRECT + 15
_SETTABLE = {*range(_DIRECT, _DIRECT + 16), _INPUT, _INPUT + 1, _ALARM_RESET, _ALARM_RESET + 1}
_SHOWN = {_OUTPUT, _OUTPUT + 1, _ALARM, _ALARM + 1} | {
    first + low for first in (_COMMAND_POSITION, _FEEDBACK_POSITION) for low in (0, 1)
}
_ZHOME, _STOP, _FREE, _ALM_RST = 4, 5, 6, 7
_HOME_END, _READY, _ALM, _MOVE, _IN_POS = 4, 5, 7, 13, 14
_KINDS = (1, 2, 3)  # absolute, incremental on the command, incremental on the feedback
_NO_FUNCTION, _NO_ADDRESS, _NO_VALUE = 1, 2, 3


class Refusal(Exception):
    """An exception reply, by its code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class OrientalController:
    """One drive. `triggers` counts the direct data operations that were started.

    `now_s` tells the age of bytes and of an overload, in seconds.
    """

    def __init__(
        self,
        motor: Motor,
        unit: int = 1,
        steps_per_deg: float = 100.0,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.motor, self.unit, self.steps_per_deg = motor, unit, steps_per_deg
        self.triggers = self.homings = 0
        self._now_s = now_s
        self._set = dict.fromkeys(_SETTABLE, 0)
        self._set[_DIRECT + 3], self._set[_DIRECT + 13] = 2, 1000  # type and current as delivered
        self._command_steps = self._feedback()
        self._frame, self._last_s = b"", now_s()
        self._free = False
        self._stuck_at_deg, self._stuck_since_s = motor.position_deg, now_s()

    def answer(self, data: bytes) -> bytes:
        """What it sends on a serial line once these bytes have reached it."""
        now_s = self._now_s()
        self._frame = data if now_s - self._last_s > GAP_S else self._frame + data
        self._last_s = now_s
        out = b""
        while (size := _size(self._frame)) and len(self._frame) >= size:
            frame, self._frame = self._frame[:size], self._frame[size:]
            if crc(frame[:-2]) != frame[-2:]:
                self._frame = b""  # noise: deaf until the line has been quiet
                break
            out += self._framed(frame)
        return out

    def serve(self, request: bytes) -> bytes:
        """The answer to a request without its frame: function code and data."""
        function = request[0]
        try:
            self._look()
            return bytes([function]) + self._done(function, request[1:])
        except Refusal as refusal:
            return bytes([0x80 | function, refusal.code])

    def _framed(self, frame: bytes) -> bytes:
        unit = frame[0]
        if unit not in (0, self.unit):
            return b""
        answer = frame[:1] + self.serve(frame[1:-2])
        return answer + crc(answer) if unit else b""  # to all: no answer

    def _done(self, function: int, body: bytes) -> bytes:
        if function not in (3, 6, 16):
            raise Refusal(_NO_FUNCTION)
        if len(body) < 4:
            raise Refusal(_NO_VALUE)
        register, second = _word(body, 0), _word(body, 2)
        if function == 3:
            return self._read(register, second)
        if function == 6:
            self._write(register, [second])
            return body[:4]
        if not 1 <= second <= 123 or len(body) != 5 + 2 * second or body[4] != 2 * second:
            raise Refusal(_NO_VALUE)
        self._write(register, [_word(body, 5 + 2 * i) for i in range(second)])
        return body[:4]

    def _read(self, register: int, count: int) -> bytes:
        if not 1 <= count <= 125:
            raise Refusal(_NO_VALUE)
        wanted = range(register, register + count)
        if not set(wanted) <= _SETTABLE | _SHOWN:
            raise Refusal(_NO_ADDRESS)
        values = self._set | self._shown()
        return bytes([2 * count]) + b"".join(values[r].to_bytes(2, "big") for r in wanted)

    def _shown(self) -> dict[int, int]:
        alarm = int(self.motor.alarm, 16) if self.motor.alarm else 0
        return {
            **_pair(_OUTPUT, self._output()),
            **_pair(_ALARM, alarm),
            **_pair(_COMMAND_POSITION, self._command_steps),
            **_pair(_FEEDBACK_POSITION, self._feedback()),
        }

    def _output(self) -> int:
        motor = self.motor
        moving, alarm = motor.moving, bool(motor.alarm)
        on = {
            _HOME_END: motor.referenced and not motor.homing,
            _READY: not (moving or alarm or self._free or self._input(_STOP)),
            _ALM: alarm,
            _MOVE: moving,
            _IN_POS: not moving,
        }
        return sum(1 << bit for bit, is_on in on.items() if is_on)

    def _write(self, register: int, values: list[int]) -> None:
        written = dict(zip(range(register, register + len(values)), values, strict=True))
        if not written.keys() <= _SETTABLE:
            raise Refusal(_NO_ADDRESS)
        before, after = self._set, self._set | written
        kind = _signed(after, _DIRECT + 2)
        if kind not in _KINDS or not 0 <= _signed(after, _DIRECT + 12) <= 1000:
            raise Refusal(_NO_VALUE)
        self._set = after
        self._act_on_inputs(before[_INPUT + 1], after[_INPUT + 1])
        if after[_ALARM_RESET + 1] and not before[_ALARM_RESET + 1]:
            self.motor.alarm = ""
        if written.get(_TRIGGER) == 1:
            self._start(kind)

    def _act_on_inputs(self, before: int, after: int) -> None:
        edges = after & ~before
        self._free = bool(after >> _FREE & 1)
        if edges >> _ALM_RST & 1:
            self.motor.alarm = ""
        if (edges >> _STOP | edges >> _FREE) & 1:
            self.motor.stop()
        if edges >> _ZHOME & 1 and self._output() >> _READY & 1:
            self.homings += 1
            self.motor.home()

    def _start(self, kind: int) -> None:
        if not self._output() >> _READY & 1:
            return
        self.triggers += 1
        origin = {1: 0, 2: self._command_steps, 3: self._feedback()}[kind]
        steps = origin + _signed(self._set, _DIRECT + 4)
        angle_deg, can = steps / self.steps_per_deg, self.motor.mechanics
        if not can.min_deg <= angle_deg <= can.max_deg:
            self.motor.fail("67")
            return
        self._command_steps = steps
        self._stuck_at_deg, self._stuck_since_s = float("nan"), self._now_s()
        self.motor.move(angle_deg)

    def _look(self) -> None:
        """Find an overload: pushing for long without getting on."""
        at_deg, now_s = self.motor.position_deg, self._now_s()
        if at_deg != self._stuck_at_deg or not self.motor.moving or self.motor.homing:
            self._stuck_at_deg, self._stuck_since_s = at_deg, now_s
        elif now_s - self._stuck_since_s > OVERLOAD_S:
            self.motor.fail("30")

    def _input(self, bit: int) -> bool:
        return bool(self._set[_INPUT + 1] >> bit & 1)

    def _feedback(self) -> int:
        return round(self.motor.position_deg * self.steps_per_deg)


def crc(data: bytes) -> bytes:
    """The two check bytes of Modbus RTU: polynomial A001 hex, from FFFF hex, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def _size(frame: bytes) -> int:
    """How long a request is, with its frame; 0 as long as that is not known."""
    if len(frame) < 4:
        return 0
    if frame[1] == 16:
        return 9 + frame[6] if len(frame) > 6 else 0
    if frame[1] <= 6:
        return 8
    return len(frame)  # a function that is not served: as it came


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")


def _signed(registers: dict[int, int], first: int) -> int:
    words = registers[first].to_bytes(2, "big") + registers[first + 1].to_bytes(2, "big")
    return int.from_bytes(words, "big", signed=True)


def _pair(first: int, value: int) -> dict[int, int]:
    data = value.to_bytes(4, "big", signed=True)
    return {first: _word(data, 0), first + 1: _word(data, 2)}
