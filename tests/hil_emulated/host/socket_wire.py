"""Far end of a serial adapter: a Unix socket on which an emulated controller answers."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence
from pathlib import Path

from sim.emulated.wire import Controller, Wire


class SocketWire(Wire):
    """Wire whose port is the socket at `path`; qemu's adapter connects to it."""

    def __init__(self, controllers: Sequence[Controller], path: Path) -> None:
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(str(path))
        self._listener.listen()
        self._connected: socket.socket | None = None
        super().__init__(controllers)

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return  # closed
            with connection, contextlib.suppress(OSError):  # closed, or the computer is off
                self._connected = connection
                while data := connection.recv(4096):
                    self._receive(data)

    def _send(self, data: bytes) -> None:
        if self._connected is not None:
            with contextlib.suppress(OSError):  # the computer is off
                self._connected.sendall(data)

    def _unplug(self) -> None:
        for end in (self._connected, self._listener):
            if end is not None:
                with contextlib.suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
                end.close()
