"""Emulated Modbus TCP gateway: TCP port, and frames for the drives behind it."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence
from typing import Protocol

from sim.emulated.wire import Controller, Wire

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


class TcpWire(Wire):
    """TCP port of a gateway; the master connects to `host` and `port`."""

    host = "127.0.0.1"

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._listener = socket.create_server((self.host, 0))
        self.port: int = self._listener.getsockname()[1]
        self._peer: socket.socket | None = None
        super().__init__(controllers)

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                self._peer, _ = self._listener.accept()
                with self._peer as peer:  # closed before the next connection is accepted
                    while data := peer.recv(4096):
                        self._receive(data)
            except OSError:
                continue  # unplugged, or the master has disconnected

    def _send(self, data: bytes) -> None:
        if self._peer is not None:
            with contextlib.suppress(OSError):  # the master has disconnected
                self._peer.sendall(data)

    def _unplug(self) -> None:
        for end in (self._peer, self._listener):
            if end is not None:
                with contextlib.suppress(OSError):  # not connected
                    end.shutdown(socket.SHUT_RDWR)
                end.close()
