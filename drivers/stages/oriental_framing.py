"""Framing of Oriental Motor's AZ drives: registers, bits, alarms, and steps as 32-bit values.

Registers, bits and alarms are those of the maker's AZ function manual (Modbus RTU, direct data
operation). A 32-bit value takes two registers, the high word first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from instrument.errors import DeviceError

DIRECT_DATA = 0x0058  # the first of the 16 registers of a direct data operation
DIRECT_DATA_COUNT = 16
INPUT_WORD = 0x007D  # driver input command, low word
OUTPUT = 0x007E  # driver output status, 2 registers; the alarm code's 2 follow it at 0080
OUTPUT_AND_ALARM_COUNT = 4
FEEDBACK_POSITION = 0x00CC  # 2 registers, steps; 00C6 would be the commanded position

# Input word, 007D.
ZHOME = 1 << 4
STOP = 1 << 5
# Output word, 007F.
HOME_END = 1 << 4
READY = 1 << 5
ALM = 1 << 7
MOVE = 1 << 13

ABSOLUTE = 1  # operation type of direct data
TRIGGER_ALL = 1  # everything in the block takes effect
FULL_CURRENT = 1000  # 1 = 0.1 %
_LOW32, _HIGH32 = -(1 << 31), (1 << 31) - 1

_ALARMS = {
    0x30: ("overload", "look for what holds the stage, and at its load and acceleration"),
    0x66: ("hardware overtravel", "look at the limit switches, and at where the stage stands"),
    0x67: ("software overtravel", "compare the drive's software limits with the rig file's"),
}


@dataclass(frozen=True, slots=True)
class DirectData:
    """Registers of a direct data operation: steps, Hz (steps/s), steps/s², 0.1 % of the current."""

    number: int
    kind: int
    position: int
    speed_hz: int
    acceleration: int
    deceleration: int
    current: int
    trigger: int


@dataclass(frozen=True, slots=True)
class Output:
    """Registers 007E to 0081: the output word and the alarm code, 0 for none."""

    word: int
    alarm: int

    @property
    def fault(self) -> str:
        """The alarm and what to look at, or an empty text."""
        return alarm_text(self.alarm) if self.alarm or self.word & ALM else ""

    def has(self, bit: int) -> bool:
        """True if a bit of the output word is set."""
        return bool(self.word & bit)


def words_of(value: int) -> tuple[int, int]:
    """Split a signed 32-bit value into two registers, the high word first."""
    if not _LOW32 <= value <= _HIGH32:
        raise DeviceError(f"{value} does not fit a 32-bit register ({_LOW32} to {_HIGH32})")
    return (value >> 16) & 0xFFFF, value & 0xFFFF


def value_of(words: Sequence[int]) -> int:
    """Return the signed 32-bit value in two registers, the high word first."""
    high, low = words
    value = high << 16 | low
    return value - (1 << 32) if value > _HIGH32 else value


def steps_of(angle_deg: float, steps_per_deg: float) -> int:
    """Convert an angle in degrees to whole steps."""
    steps = angle_deg * steps_per_deg
    if not (math.isfinite(steps) and _LOW32 <= round(steps) <= _HIGH32):
        raise DeviceError(
            f"{angle_deg:g} deg at {steps_per_deg:g} steps per degree is {steps:g} steps; the "
            f"drive counts from {_LOW32} to {_HIGH32}: look at steps_per_deg in the rig file"
        )
    return round(steps)


def degrees_of(steps: int, steps_per_deg: float) -> float:
    """Convert steps to degrees."""
    return steps / steps_per_deg


def move_block(position_steps: int, speed_hz: int, acceleration: int) -> tuple[int, ...]:
    """Return the 16 registers from 0058 that start an absolute move at full current.

    `speed_hz` is in steps/s. `acceleration` counts 0.001 kHz/s, which is 1 step/s²: four
    independent open drivers of AZ drives use this unit, and the maker's example agrees (05DC hex =
    1.5 kHz/s to reach 2000 Hz). It requires the drive's parameter "acceleration/deceleration unit"
    at its default, kHz/s. The others are s and ms/kHz, and no register known here shows which is
    set. With a wrong unit the ramps are too long or too short, but the angle is right.
    """
    parts = (
        0, ABSOLUTE, position_steps, max(speed_hz, 1), max(acceleration, 1), max(acceleration, 1),
        FULL_CURRENT, TRIGGER_ALL,
    )  # fmt: skip
    return tuple(word for part in parts for word in words_of(part))


def direct_data_of(words: Sequence[int]) -> DirectData:
    """Parse the 16 registers from 0058."""
    pairs = zip(words[::2], words[1::2], strict=True)
    return DirectData(*(value_of(pair) for pair in pairs))


def output_of(words: Sequence[int]) -> Output:
    """Parse the 4 registers from 007E."""
    return Output(words[1], value_of(words[2:4]))


def alarm_text(code: int) -> str:
    """Return an alarm with its meaning and what to look at."""
    meaning, look = _ALARMS.get(code, ("not known here", "look it up in the AZ drive's manual"))
    return f"alarm {code:02X}h ({meaning}): {look}, then switch the drive off and on"


def az_mismatch(data: DirectData, output: Output) -> str:
    """Return a reason why the answers cannot be an AZ drive's, or an empty text.

    No register with a name or serial number is known, so the values are checked against the ranges
    of an AZ drive.
    """
    if not 0 <= output.alarm <= 0xFF:
        return f"alarm code {output.alarm:X} hex (an AZ drive's are 00 to FF)"
    if bool(output.alarm) != output.has(ALM):
        return f"alarm code {output.alarm:02X}h, but output word {output.word:04X} hex"
    if not 0 <= data.number <= 255:
        return f"data number {data.number} (an AZ drive's are 0 to 255)"
    if not 0 <= data.current <= FULL_CURRENT:
        return f"operating current {data.current} (an AZ drive's is 0 to {FULL_CURRENT})"
    return ""
