"""Framing of Newport's SMC100 and CONEX-CC: commands, answers, states and error codes.

ASCII, one command per line: `{address}{two letters}{value}` and CR LF. The answer to a query
repeats address and letters. A command that sets something has no answer: TE is queried after it.
From the manuals of both controllers; their tables of states differ a little, and both are here.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.lines.serial_line import Garbled, number_of

END = b"\r\n"

# Letters returned by TE.
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

# Error bits returned by TS: what is wrong, and what to look at.
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

_STATES = {
    "not referenced": range(0x0A, 0x12),
    "configuration": range(0x14, 0x15),
    "homing": range(0x1E, 0x20),
    "moving": range(0x28, 0x29),
    "ready": range(0x32, 0x39),  # 36 to 38: CONEX only
    "disabled": range(0x3C, 0x40),  # 3F: CONEX only
    "jogging": range(0x46, 0x48),  # TRACKING of a CONEX
}


@dataclass(frozen=True, slots=True)
class State:
    """Parsed answer to TS: error bits (0 for none) and the name of the state."""

    errors: int
    name: str

    @property
    def moving(self) -> bool:
        """True while the axis moves."""
        return self.name in ("homing", "moving", "jogging")

    @property
    def homed(self) -> bool:
        """True if the reference is known."""
        return self.name in ("moving", "ready", "disabled", "jogging")

    @property
    def fault(self) -> str:
        """Reasons that forbid a motion, or an empty text."""
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
    """Return a command line for the controller, such as `1PA12.5` and CR LF."""
    text = value if isinstance(value, str) else f"{value:.6f}".rstrip("0").rstrip(".")
    return f"{address}{letters}{text}".encode("ascii") + END


def answer_to(address: int, letters: str, line: bytes) -> str | None:
    """Return the value in the answer to a query; None if the line is not its answer."""
    prefix = f"{address}{letters}".encode("ascii")
    if not line.startswith(prefix):
        return None
    try:
        text = line[len(prefix) :].decode("ascii").strip()
    except UnicodeDecodeError:
        return None
    return text if text.isprintable() else None


def number(who: str, letters: str, text: str) -> float:
    """Return the finite number in an answer, in the stage's unit; raise `Garbled` for others."""
    value = number_of(text)
    if value is None:
        raise Garbled(f"{who}: answers {letters} with {text!r}; expected: a number")
    return value


def state(who: str, text: str) -> State:
    """Parse the six hexadecimal digits of TS; raise `Garbled` for others and unknown states."""
    digits = "0123456789ABCDEF"
    if len(text) != 6 or any(c not in digits for c in text.upper()):
        raise Garbled(f"{who}: answers TS with {text!r}; expected: six hexadecimal digits")
    code = int(text[4:], 16)
    for name, codes in _STATES.items():
        if code in codes:
            return State(int(text[:4], 16), name)
    raise Garbled(
        f"{who}: answers TS with {text!r}: {text[4:]} is not a state that this program knows"
    )
