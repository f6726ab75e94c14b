"""Zaber's ASCII protocol: commands and replies as bytes, warning flags in words.

`/{device} {axis} {id} command:CC` and CR LF; reply `@01 1 id OK IDLE -- data:CC`. CC is the two's
complement of the sum of the bytes between the lead character and the colon. Alerts begin with `!`,
information with `#`. From the maker's protocol manual.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

END = b"\r\n"
IDS = 100  # message ids run from 00 to 99
SPEED_PER_MICROSTEP = 1.6384  # speed data for one microstep a second

# Warning flags that begin with F: faults, by the maker's list, and what to look at.
FAULTS = {
    "FF": "critical system error: switch it off and on; if it stays, ask the maker",
    "FN": "peripheral not supported: look at which stage is plugged in",
    "FZ": "peripheral inactive: look at which stage is plugged in, then activate it",
    "FH": "emergency stop, driver off: release it, then home the stage",
    "FV": "voltage too high or too low, driver off: look at the power supply",
    "FO": "driver switched off: switch it on (driver enable), then home the stage",
    "FC": "inrush current error: look at the power supply",
    "FM": "motor temperature error: let it cool, look for what holds the stage",
    "FD": "driver disabled, too hot or too much current: let it cool, look at the supply",
    "FQ": "encoder error: look at the encoder's cable, then home the stage",
    "FI": "index error: look at the encoder's cable, then home the stage",
    "FA": "analogue encoder out of step: look at the encoder's cable, then home the stage",
    "FR": "overdrive limit exceeded: look for what holds the stage",
    "FS": "stalled and stopped: look for what holds the stage, then home it",
    "FB": "stream bounds error: another program drives this device",
    "FP": "path deviation: look for what holds the stage, then home it",
    "FE": "limit error: look at the limit sensor and its cable",
    "FT": "excessive twist: turn the axis back by hand, then home it",
}
NO_WARNING = "--"
NOT_HOMED = ("WH", "WR")  # WH: not homed yet; WR: no reference position

_REPLY = re.compile(rb"@(\d\d) (\d) (?:(\d\d) )?(OK|RJ) (IDLE|BUSY) ([!-~]{2}) ?([ -9;-~]*)")


@dataclass(frozen=True, slots=True)
class Reply:
    """A reply taken apart; `warning` is the most urgent one."""

    device: int
    axis: int
    message_id: int | None
    accepted: bool
    busy: bool
    warning: str
    data: str


def homed(flags: Sequence[str]) -> bool:
    """Whether a device with these warning flags knows where it is."""
    return not any(flag in NOT_HOMED for flag in flags)


def fault(flags: Sequence[str]) -> str:
    """Why nothing may move, or nothing."""
    unknown = "a fault that this program does not know: see the manual"
    return "; ".join(f"{f} {FAULTS.get(f, unknown)}" for f in flags if f.startswith("F"))


def checksum(body: bytes) -> bytes:
    """Two hexadecimal digits for the bytes between the lead character and the colon."""
    return b"%02X" % (-sum(body) & 0xFF)


def command(device: int, axis: int, message_id: int, text: str) -> bytes:
    """One line to the device: `/1 1 07 move abs 10000:CC` and CR LF."""
    body = f"{device} {axis} {message_id:02d} {text}".encode("ascii")
    return b"/" + body + b":" + checksum(body) + END


def reply_of(line: bytes) -> Reply | None:
    """A line taken apart; None where it is no whole reply: an alert, noise, a wrong checksum.

    The checksum finds any one byte that is wrong, and lets one in 256 of larger damages pass; two
    bytes that have changed places have the same sum.
    """
    body, colon, check = line.partition(b":")
    if not colon or check.upper() != checksum(body[1:]):
        return None
    found = _REPLY.fullmatch(body)
    if found is None:
        return None
    device, axis, number, flag, status, warning, data = found.groups()
    return Reply(
        int(device),
        int(axis),
        None if number is None else int(number),
        flag == b"OK",
        status == b"BUSY",
        warning.decode("ascii"),
        data.decode("ascii").strip(),
    )
