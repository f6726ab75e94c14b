"""Emulated Newport SMC100 or CONEX-CC: states, error codes and answers as in the maker's manuals.

Transcripts: the versions and the form of the stage's name are quoted from public laboratory notes
and drivers' tests of real controllers (SMC100CC, CONEX-CC). Not verified on a device: the answers'
number of decimals, the time of an answer (here none; a query takes some 10 ms), and the SMC_PP.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from sim.emulated.motor import Motor

_NOT_REFERENCED, _HOMING, _MOVING, _READY_HOMED, _READY_MOVED = "0A", "1E", "28", "32", "33"
_DISABLED = "3C"
_ALL_AXES = ""
STAGE = "URS100CC"
VERSIONS = {
    "SMC100": " SMC_CC - Controller-driver version  3. 1. 2",
    "CONEX-CC": " CONEX-CC 2.0.1",
}


class NewportController:
    """One controller at an address. `motor.alarm` holds the four error digits of `TS`.

    `moves`: number of moves started. `deaf_s`: time after a command in which nothing is heard; ten
    public drivers wait 60 ms.
    """

    def __init__(
        self,
        motor: Motor,
        address: int = 1,
        model: str = "SMC100",
        stage: str = STAGE,
        deaf_s: float = 0.0,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._deaf_s, self._now_s, self._hears_at_s = deaf_s, now_s, now_s()
        self.motor, self.address = motor, address
        self._version = VERSIONS[model]
        self._stage = stage
        self._buffer = b""
        self._error = "@"
        self._moved = False
        self.values = {
            "SL": motor.mechanics.min_deg,
            "SR": motor.mechanics.max_deg,
            "VA": motor.mechanics.speed_deg_per_s,
            "AC": motor.mechanics.acceleration_deg_per_s2,
        }
        self.moves = 0

    def answer(self, data: bytes) -> bytes:
        """Return the answers to all lines completed by these bytes."""
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        return b"".join(
            self._answer_line(line.strip().decode("ascii", "replace"))
            for line in lines
            if self._now_s() >= self._hears_at_s
        )

    def _answer_line(self, line: str) -> bytes:
        digits = line[: len(line) - len(line.lstrip("0123456789"))]
        letters, value = line[len(digits) : len(digits) + 2], line[len(digits) + 2 :]
        if digits not in (str(self.address), _ALL_AXES):
            return b""  # addressed to another controller
        answer = self._execute(letters, value)
        return b"" if answer is None else f"{self.address}{letters}{answer}\r\n".encode("ascii")

    def _execute(self, letters: str, value: str) -> str | None:
        """Execute a command; return its answer, None for a command without one."""
        queries: dict[str, Callable[[], str]] = {
            "TS": lambda: self._errors() + self._state(),
            "TP": lambda: f"{self.motor.position_deg:.6f}",
            "TE": self._take_error,
            "VE": lambda: self._version,
            "ID": lambda: self._stage,
        }
        if letters in queries:
            return queries[letters]()
        if letters in self.values and value == "?":
            return f"{self.values[letters]:g}"
        self._act(letters, value)
        self._hears_at_s = self._now_s() + self._deaf_s
        return None

    def _act(self, letters: str, value: str) -> None:
        error = "@"
        if letters == "PA":
            error = self._move(value)
        elif letters == "OR":
            error = self._home()
        elif letters == "ST":
            self.motor.stop()
        elif letters in ("VA", "AC"):
            error = self._set(letters, value)
        else:
            error = "A"
        if error != "@":
            self._error = error  # kept until TE reads it

    def _home(self) -> str:
        if self._state() != _NOT_REFERENCED:
            return "K"
        self.motor.home()
        return "@"

    def _move(self, value: str) -> str:
        state, target = self._state(), _number(value)
        refused = {_NOT_REFERENCED: "H", _HOMING: "L", _MOVING: "M", _DISABLED: "J"}
        if state in refused:
            return refused[state]
        if target is None:
            return "C"
        if not self.values["SL"] <= target <= self.values["SR"]:
            return "N"
        self.moves += 1
        self._moved = True
        self.motor.move(target)
        return "@"

    def _set(self, letters: str, value: str) -> str:
        number = _number(value)
        if number is None or number <= 0:
            return "C"
        self.values[letters] = number
        self.motor.set_speed(self.values["VA"], self.values["AC"])
        return "@"

    def _take_error(self) -> str:
        error, self._error = self._error, "@"
        return error

    def _errors(self) -> str:
        return self.motor.alarm or "0000"

    def _state(self) -> str:
        if self.motor.homing:
            return _HOMING
        if self.motor.alarm and self.motor.referenced:
            return _DISABLED
        if not self.motor.referenced:
            return _NOT_REFERENCED
        if self.motor.moving:
            return _MOVING
        return _READY_MOVED if self._moved else _READY_HOMED


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
