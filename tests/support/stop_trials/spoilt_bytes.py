"""Controller behind a line on which one byte is lost or changed, or answers get lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller

# Stops on the wire: ASCII lines, and the write of STOP into the AZ drive's input word.
STOPS = {
    "zaber": b" stop", "smc100": b"ST", "conex": b"ST",
    "az rtu": bytes.fromhex("06007D0020"), "az tcp": bytes.fromhex("06007D0020"),
}  # fmt: skip
_GATEWAY_SILENT = 0x0B  # exception code: the device behind the gateway did not answer


@dataclass
class Spoiling:
    """What happens to the bytes of one line: armed once, by time.

    `log`: time (monotonic, in s), direction and bytes of each message as the controller got it.
    """

    stop: bytes
    log: list[tuple[float, str, bytes]] = field(default_factory=list)
    _change: Callable[[bytes, int, int], bytes] | None = None
    _spoils_back: bool = False
    _stopped: bool = False
    _left: int = 0
    _mute_until_s: float = 0.0

    def spoil(self, fault: str, at: float, back: bool, times: int) -> None:
        """Lose, or change, one byte at this part of the length of each of the next stops.

        `back`: of the answers after the first one.
        """

        def changed(data: bytes, begin: int, end: int) -> bytes:
            index = begin + int(at * (end - begin))
            kept = b"" if fault == "lost byte" else bytes([data[index] ^ 0x15])
            return data[:index] + kept + data[index + 1 :]

        self._change, self._spoils_back, self._left = changed, back, times

    def _place(self, data: bytes) -> tuple[int, int]:
        """Return where the message begins and ends that holds the stop."""
        found = data.find(self.stop)
        if not self.stop.strip().isalpha():  # a frame: the function follows the unit address
            return max(found - 1, 0), len(data)
        end = data.find(b"\n", found) + 1
        return data.rfind(b"\n", 0, found) + 1, end or len(data)

    def lose_answers(self, seconds: float) -> None:
        """Lose all answers from now on, for so long."""
        self._mute_until_s = time.monotonic() + min(seconds, 1e9)

    def on_the_way(self, data: bytes) -> bytes:
        """Return what reaches the controller."""
        if self.stop in data:
            self._stopped = True
            if not self._spoils_back:
                data = self._spoilt(data, *self._place(data))
        self.log.append((time.monotonic(), "in", data))
        return data

    def _spoilt(self, data: bytes, begin: int, end: int) -> bytes:
        if self._change is None or self._left == 0:
            return data
        self._left -= 1
        return self._change(data, begin, end)

    def back(self, answer: bytes) -> bytes:
        """Return what reaches the program."""
        if not answer:
            return b""
        if self._spoils_back and self._stopped:
            answer = self._spoilt(answer, 0, len(answer))
        kept = b"" if time.monotonic() < self._mute_until_s else answer
        self.log.append((time.monotonic(), "out" if kept else "lost", answer))
        return kept


class SpoiltLine:
    """Serial line to a controller."""

    def __init__(self, controller: Controller, spoiling: Spoiling) -> None:
        self._controller, self._spoiling = controller, spoiling

    def answer(self, data: bytes) -> bytes:
        return self._spoiling.back(self._controller.answer(self._spoiling.on_the_way(data)))


class SpoiltDrive:
    """Drive behind a gateway: the gateway reports what gets lost on the line behind it."""

    def __init__(self, drive: OrientalController, spoiling: Spoiling) -> None:
        self._drive, self._spoiling, self.unit = drive, spoiling, drive.unit

    def serve(self, request: bytes) -> bytes:
        arrived = self._spoiling.on_the_way(request)
        answer = self._drive.serve(request) if arrived == request else b""
        whole = answer and self._spoiling.back(answer) == answer
        return answer if whole else bytes([0x80 | request[0], _GATEWAY_SILENT])
