"""Newport SMC100 and CONEX-CC: commands and answers as bytes, status words in words.

ASCII, one command a line, `{address}{two letters}{value}` and CR LF; a query's answer repeats
address and letters. A command that sets something does not answer: TE is asked afterwards. From
the makers' manuals of both controllers (their tables of states differ a little; both are here).
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.lines.serial_line import Garbled, number_of

END = b"\r\n"

# TE's letters.
ERRORS = {
    "A": "does not know the command",
    "B": "its address is wrong",
    "C": "the value is missing or out of range",
    "D": "the command is not allowed",
    "E": "it is homing already",
    "G": "the move would pass a displacement limit",
    "H": "it has no reference: home it first",
    "I": "it is in its configuration state",
    "J": "it is disabled",
    "K": "not allowed while it is ready",
    "L": "not allowed while it is homing",
    "M": "not allowed while it is moving",
    "N": "the position is beyond its own soft limit",
    "S": "communication time-out",
    "U": "its memory has an error",
    "V": "it could not carry the command out",
}

# TS's error bits: what is wrong, and what to look at.
FAULTS = {
    0x0200: "80 W output power exceeded: look for what holds the stage",
    0x0100: "motor supply too low: look at the supply's plug and fuse",
    0x0080: "wrong stage connected: look at the motor's cable and the controller's stage settings",
    0x0040: "homing timed out: look at the reference switch",
    0x0020: "following error: look for what holds the stage, then home it",
    0x0010: "short circuit: look at the motor's cable",
    0x0008: "root mean square current exceeded: look for what holds the stage",
    0x0004: "peak current exceeded: look for what holds the stage",
    0x0002: "positive end of run reached: move it back by hand, then home it",
    0x0001: "negative end of run reached: move it back by hand, then home it",
}

_NOT_REFERENCED = range(0x0A, 0x12)
_CONFIGURATION = range(0x14, 0x15)
_HOMING = range(0x1E, 0x20)
_MOVING = range(0x28, 0x29)
_READY = range(0x32, 0x39)  # 36 to 38: CONEX only
_DISABLED = range(0x3C, 0x40)  # 3F: CONEX only
_JOGGING = range(0x46, 0x48)  # TRACKING of a CONEX

_STATES = {
    "not referenced": _NOT_REFERENCED,
    "configuration": _CONFIGURATION,
    "homing": _HOMING,
    "moving": _MOVING,
    "ready": _READY,
    "disabled": _DISABLED,
    "jogging": _JOGGING,
}


@dataclass(frozen=True, slots=True)
class State:
    """TS taken apart: error bits (0 where all is well) and the state's name."""

    errors: int
    name: str

    @property
    def moving(self) -> bool:
        """Whether the axis is on its way."""
        return self.name in ("homing", "moving", "jogging")

    @property
    def homed(self) -> bool:
        """Whether the reference is known."""
        return self.name in ("moving", "ready", "disabled", "jogging")

    @property
    def fault(self) -> str:
        """Why nothing may move, or nothing."""
        found = [f"{bit:04X} {text}" for bit, text in FAULTS.items() if self.errors & bit]
        unknown = self.errors & ~sum(FAULTS)
        if unknown:
            found.append(f"{unknown:04X} unknown to this program: see the controller's manual")
        if self.name == "disabled":
            found.append("motor disabled: enable it at the controller (MM1), then home it")
        if self.name == "configuration":
            found.append("controller in its configuration state: leave it (PW0) before a scan")
        return "; ".join(found)


def command(address: int, letters: str, value: str | float = "") -> bytes:
    """One line to the controller: `1PA12.5` and CR LF."""
    text = value if isinstance(value, str) else f"{value:.6f}".rstrip("0").rstrip(".")
    return f"{address}{letters}{text}".encode("ascii") + END


def answer_to(address: int, letters: str, line: bytes) -> str | None:
    """What an answer to that query says; None where the line is no answer to it."""
    prefix = f"{address}{letters}".encode("ascii")
    if not line.startswith(prefix):
        return None
    try:
        text = line[len(prefix) :].decode("ascii").strip()
    except UnicodeDecodeError:
        return None
    return text if text.isprintable() else None


def number(who: str, letters: str, text: str) -> float:
    """The value of an answer, in the stage's unit, finite. Raises `Garbled` where it is none."""
    value = number_of(text)
    if value is None:
        raise Garbled(f"{who}: answers {letters} with {text!r}; expected: a number")
    return value


def state(who: str, text: str) -> State:
    """TS's six hexadecimal digits. Raises `Garbled` where they are none, or name no state."""
    digits = "0123456789ABCDEF"
    if len(text) != 6 or any(c not in digits for c in text.upper()):
        raise Garbled(f"{who}: answers TS with {text!r}; expected: six hexadecimal digits")
    code = int(text[4:], 16)
    for name, codes in _STATES.items():
        if code in codes:
            return State(int(text[:4], 16), name)
    raise Garbled(
        f"{who}: answers TS with {text!r}: {text[4:]} is no state that this program knows"
    )
