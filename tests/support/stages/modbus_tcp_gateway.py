"""Emulated Modbus TCP gateway: TCP port, and frames for the drives behind it."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import Protocol

from sim.emulated.wire import Controller
from tests.support.stages.socket_wire import SocketWire

_HEADER = 7  # bytes: transaction (2), protocol = 0 (2), length (2), unit (1)
_MAX_FRAME = 260  # bytes
_TARGET_DID_NOT_RESPOND = 0x0B  # the gateway's exception code


class ModbusDevice(Protocol):
    """Device behind the gateway, by its unit address."""

    unit: int

    def serve(self, request: bytes) -> bytes:
        """Return the answer to a request; both are function code and data without a frame."""
        ...


class ModbusTcpGateway:
    """Gateway that serves several devices on one connection; requests may arrive in pieces."""

    def __init__(self, devices: Sequence[ModbusDevice]) -> None:
        self._devices = {device.unit: device for device in devices}
        self._buffer = b""

    def answer(self, data: bytes) -> bytes:
        """Return the answers to all requests completed by these bytes."""
        self._buffer += data
        out = b""
        while len(self._buffer) >= _HEADER:
            protocol, length = (int.from_bytes(self._buffer[i : i + 2], "big") for i in (2, 4))
            if protocol or not 2 <= length <= _MAX_FRAME - 6:
                self._buffer = b""  # not Modbus: frame boundaries are unknown from here on
                break
            if len(self._buffer) < 6 + length:
                break
            frame, self._buffer = self._buffer[: 6 + length], self._buffer[6 + length :]
            out += self._serve(frame)
        return out

    def _serve(self, frame: bytes) -> bytes:
        request = frame[_HEADER:]
        device = self._devices.get(frame[6])
        exception = bytes([0x80 | request[0], _TARGET_DID_NOT_RESPOND])
        answer = device.serve(request) if device else exception
        return frame[:4] + (1 + len(answer)).to_bytes(2, "big") + frame[6:7] + answer


class TcpWire(SocketWire):
    """TCP port of a gateway, any free one by default; the master connects to `host` and `port`."""

    host = "127.0.0.1"

    def __init__(self, controllers: Sequence[Controller], port: int = 0) -> None:
        listener = socket.create_server((self.host, port))
        self.port: int = listener.getsockname()[1]
        super().__init__(controllers, listener)
