"""Emulated Oriental Motor AZ drive: Modbus RTU requests in, answers out.

Framing and registers are written a second time here, from the maker's manual and the Modbus
specification, and share no code with the driver, so that an error in one is caught by the other.

Transcripts: the maker's own example of a direct data operation, byte for byte; the CRC of the
Modbus specification; independent masters and slaves in the tests. Not verified on a drive: the
factory settings of the direct data, which requests it refuses with which exception, the time of an
answer (here none), and READY, MOVE and IN-POS between a trigger and the first step. Acceleration
and deceleration are one here.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from sim.emulated.motor import Motor

GAP_S = 0.05  # a longer pause between bytes starts a new frame
OVERLOAD_S = 5.0  # a move without progress for so long is an overload

_DIRECT, _INPUT, _OUTPUT, _ALARM = 0x58, 0x7C, 0x7E, 0x80
_COMMAND_POSITION, _FEEDBACK_POSITION, _ALARM_RESET = 0xC6, 0xCC, 0x180
_TRIGGER = _DIRECT + 15
_SETTABLE = {*range(_DIRECT, _DIRECT + 16), _INPUT, _INPUT + 1, _ALARM_RESET, _ALARM_RESET + 1}
_READABLE = {_OUTPUT, _OUTPUT + 1, _ALARM, _ALARM + 1} | {
    first + low for first in (_COMMAND_POSITION, _FEEDBACK_POSITION) for low in (0, 1)
}
_ZHOME, _STOP, _FREE, _ALM_RST = 4, 5, 6, 7
_HOME_END, _READY, _ALM, _MOVE, _IN_POS = 4, 5, 7, 13, 14
# Of the direct data: type, speed in Hz, acceleration and deceleration in 0.001 kHz/s, current.
_FACTORY = {2: 2, 6: 1000, 8: 1_000_000, 10: 1_000_000, 12: 1000}
_KINDS = (1, 2, 3)  # absolute, incremental on the command, incremental on the feedback
_BAD_FUNCTION, _BAD_ADDRESS, _BAD_VALUE = 1, 2, 3


class ModbusException(Exception):
    """Exception reply with its code."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class OrientalController:
    """One drive.

    `triggers`, `homings`: number of direct data operations and of homings started. `now_s`: clock
    in seconds for the gaps between bytes and for overloads.
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
        for offset, value in _FACTORY.items():
            self._set |= _pair(_DIRECT + offset, value)
        self._command_steps = self._feedback()
        self._frame, self._last_s = b"", now_s()
        self._coasting = False
        self._progress_deg, self._progress_s = motor.position_deg, now_s()

    def answer(self, data: bytes) -> bytes:
        """Return the answers on a serial line to all requests completed by these bytes."""
        now_s = self._now_s()
        self._frame = data if now_s - self._last_s > GAP_S else self._frame + data
        self._last_s = now_s
        out = b""
        while (size := _size(self._frame)) and len(self._frame) >= size:
            frame, self._frame = self._frame[:size], self._frame[size:]
            if crc(frame[:-2]) != frame[-2:]:
                self._frame = b""  # noise: discard until the next gap
                break
            out += self._answer_frame(frame)
        return out

    def serve(self, request: bytes) -> bytes:
        """Return the answer to a request; both are function code and data without a frame."""
        function = request[0]
        try:
            self._detect_overload()
            return bytes([function]) + self._execute(function, request[1:])
        except ModbusException as error:
            return bytes([0x80 | function, error.code])

    def _answer_frame(self, frame: bytes) -> bytes:
        unit = frame[0]
        if unit not in (0, self.unit):
            return b""
        answer = frame[:1] + self.serve(frame[1:-2])
        return answer + crc(answer) if unit else b""  # broadcast: no answer

    def _execute(self, function: int, body: bytes) -> bytes:
        if function not in (3, 6, 16):
            raise ModbusException(_BAD_FUNCTION)
        if len(body) < 4:
            raise ModbusException(_BAD_VALUE)
        register, second = _word(body, 0), _word(body, 2)
        if function == 3:
            return self._read(register, second)
        if function == 6:
            self._write(register, [second])
            return body[:4]
        if not 1 <= second <= 123 or len(body) != 5 + 2 * second or body[4] != 2 * second:
            raise ModbusException(_BAD_VALUE)
        self._write(register, [_word(body, 5 + 2 * i) for i in range(second)])
        return body[:4]

    def _read(self, register: int, count: int) -> bytes:
        if not 1 <= count <= 125:
            raise ModbusException(_BAD_VALUE)
        wanted = range(register, register + count)
        if not set(wanted) <= _SETTABLE | _READABLE:
            raise ModbusException(_BAD_ADDRESS)
        values = self._set | self._status()
        return bytes([2 * count]) + b"".join(values[r].to_bytes(2, "big") for r in wanted)

    def _status(self) -> dict[int, int]:
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
            _READY: not (moving or alarm or self._coasting or self._input(_STOP)),
            _ALM: alarm,
            _MOVE: moving,
            _IN_POS: not moving,
        }
        return sum(1 << bit for bit, is_on in on.items() if is_on)

    def _write(self, register: int, values: list[int]) -> None:
        written = dict(zip(range(register, register + len(values)), values, strict=True))
        if not written.keys() <= _SETTABLE:
            raise ModbusException(_BAD_ADDRESS)
        before, after = self._set, self._set | written
        kind, speed, ramp = (_signed(after, _DIRECT + offset) for offset in (2, 6, 8))
        if kind not in _KINDS or not 0 <= _signed(after, _DIRECT + 12) <= 1000:
            raise ModbusException(_BAD_VALUE)
        if speed == 0 or ramp < 1:
            raise ModbusException(_BAD_VALUE)
        self._set = after
        self._act_on_inputs(before[_INPUT + 1], after[_INPUT + 1])
        if after[_ALARM_RESET + 1] and not before[_ALARM_RESET + 1]:
            self.motor.alarm = ""
        if written.get(_TRIGGER) == 1:
            self._start(kind)

    def _act_on_inputs(self, before: int, after: int) -> None:
        edges = after & ~before
        self._coasting = bool(after >> _FREE & 1)
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
        angle_deg, mechanics = steps / self.steps_per_deg, self.motor.mechanics
        if not mechanics.min_deg <= angle_deg <= mechanics.max_deg:
            self.motor.fail("67")
            return
        self._command_steps = steps
        self._progress_deg, self._progress_s = float("nan"), self._now_s()
        speed, acceleration = (_signed(self._set, _DIRECT + offset) for offset in (6, 8))
        self.motor.set_speed(speed / self.steps_per_deg, acceleration / self.steps_per_deg)
        self.motor.move(angle_deg)

    def _detect_overload(self) -> None:
        """Raise the overload alarm if a move has made no progress for `OVERLOAD_S`."""
        at_deg, now_s = self.motor.position_deg, self._now_s()
        if at_deg != self._progress_deg or not self.motor.moving or self.motor.homing:
            self._progress_deg, self._progress_s = at_deg, now_s
        elif now_s - self._progress_s > OVERLOAD_S:
            self.motor.fail("30")

    def _input(self, bit: int) -> bool:
        return bool(self._set[_INPUT + 1] >> bit & 1)

    def _feedback(self) -> int:
        return round(self.motor.position_deg * self.steps_per_deg)


def crc(data: bytes) -> bytes:
    """Return the CRC-16 of Modbus RTU: polynomial A001 hex, start FFFF hex, low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value.to_bytes(2, "little")


def _size(frame: bytes) -> int:
    """Length of a request in bytes with its frame; 0 while it is unknown."""
    if len(frame) < 4:
        return 0
    if frame[1] == 16:
        return 9 + frame[6] if len(frame) > 6 else 0
    if frame[1] <= 6:
        return 8
    return len(frame)  # unsupported function: take all that has arrived


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")


def _signed(registers: dict[int, int], first: int) -> int:
    words = registers[first].to_bytes(2, "big") + registers[first + 1].to_bytes(2, "big")
    return int.from_bytes(words, "big", signed=True)


def _pair(first: int, value: int) -> dict[int, int]:
    data = value.to_bytes(4, "big", signed=True)
    return {first: _word(data, 0), first + 1: _word(data, 2)}
