"""Framing of Zaber's ASCII protocol: commands, replies, checksums and warning flags.

A command is `/{device} {axis} {id} command:CC` and CR LF, a reply `@01 1 id OK IDLE -- data:CC`. CC
is the two's complement of the sum of the bytes between the lead character and the colon. Alerts
begin with `!`, information with `#`. From the maker's protocol manual.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

END = b"\r\n"
IDS = 100  # message ids run from 00 to 99
SPEED_PER_MICROSTEP = 1.6384  # speed data for one microstep a second
# Acceleration data for one microstep/s2; three independent public programs agree. 0 would mean that
# there is no ramp at all.
ACCELERATION_PER_MICROSTEP = 1.6384e-4

# Faults, the warning flags that begin with F, from the maker's list, and what to look at.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """Parsed reply; `warning` is the most urgent one, `checked` true if it had a checksum."""

    device: int
    axis: int
    message_id: int | None
    accepted: bool
    busy: bool
    warning: str
    data: str
    checked: bool


def homed(flags: Sequence[str]) -> bool:
    """True unless a warning flag says that the reference is missing."""
    return not any(flag in NOT_HOMED for flag in flags)


def fault(flags: Sequence[str]) -> str:
    """Return the faults among warning flags, or an empty text."""
    unknown = "a fault that this program does not know: see the manual"
    return "; ".join(f"{f} {FAULTS.get(f, unknown)}" for f in flags if f.startswith("F"))


def checksum(body: bytes) -> bytes:
    """Return two hexadecimal digits for the bytes between the lead character and the colon."""
    return b"%02X" % (-sum(body) & 0xFF)


def command(device: int, axis: int, message_id: int, text: str) -> bytes:
    """Return a command line for the device: `/1 1 07 move abs 10000:CC` and CR LF."""
    body = f"{device} {axis} {message_id:02d} {text}".encode("ascii")
    return b"/" + body + b":" + checksum(body) + END


def reply_of(line: bytes, require_checksum: bool = True) -> Reply | None:
    """Parse a line; None for alerts, noise, and replies with a wrong checksum.

    The checksum finds any single wrong byte and misses one in 256 of larger errors. Two exchanged
    bytes have the same sum. A device sends it only if its setting comm.checksum is 1.
    """
    body, colon, check = line.partition(b":")
    if check.upper() != checksum(body[1:]) if colon else require_checksum:
        return None
    found = _REPLY.fullmatch(body)
    if found is None:
        return None
    device, axis, number, flag, status, warning, data = found.groups()
    return Reply(
        device=int(device),
        axis=int(axis),
        message_id=None if number is None else int(number),
        accepted=flag == b"OK",
        busy=status == b"BUSY",
        warning=warning.decode("ascii"),
        data=data.decode("ascii").strip(),
        checked=bool(colon),
    )
