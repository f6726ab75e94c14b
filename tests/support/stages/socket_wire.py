"""Wire of emulated controllers whose port is a listening socket."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Sequence
from pathlib import Path

from sim.emulated.wire import Controller, Wire


def unix_listener(path: Path) -> socket.socket:
    """Return a socket that listens at a path."""
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen()
    return listener


class SocketWire(Wire):
    """Wire that answers one connection to `listener` at a time; it closes the listener too."""

    def __init__(self, controllers: Sequence[Controller], listener: socket.socket) -> None:
        self._listener = listener
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
