"""A Modbus TCP gateway before emulated drives: their requests, under another header."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

_HEADER = 7  # transaction, protocol (0), length, unit
_MOST = 260  # the longest frame
_NO_ANSWER = 0x0B  # the gateway's: the device behind it does not answer


class Slave(Protocol):
    """A device behind the gateway."""

    unit: int

    def serve(self, request: bytes) -> bytes:
        """The answer to a request without its frame: function code and data."""
        ...


class ModbusTcpGateway:
    """Serves several drives on one connection; requests may come in pieces."""

    def __init__(self, slaves: Sequence[Slave]) -> None:
        self._slaves = {slave.unit: slave for slave in slaves}
        self._waiting = b""

    def answer(self, data: bytes) -> bytes:
        """What it sends once these bytes have reached it."""
        self._waiting += data
        out = b""
        while len(self._waiting) >= _HEADER:
            protocol, length = (int.from_bytes(self._waiting[i : i + 2], "big") for i in (2, 4))
            if protocol or not 2 <= length <= _MOST - 6:
                self._waiting = b""  # not Modbus: nothing after it can be trusted either
                break
            if len(self._waiting) < 6 + length:
                break
            frame, self._waiting = self._waiting[: 6 + length], self._waiting[6 + length :]
            out += self._served(frame)
        return out

    def _served(self, frame: bytes) -> bytes:
        request = frame[_HEADER:]
        slave = self._slaves.get(frame[6])
        answer = slave.serve(request) if slave else bytes([0x80 | request[0], _NO_ANSWER])
        return frame[:4] + (1 + len(answer)).to_bytes(2, "big") + frame[6:7] + answer
