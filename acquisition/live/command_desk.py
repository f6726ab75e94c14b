"""Unix socket on which a running scan takes commands from those who watch it."""

from __future__ import annotations

import os
import select
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from acquisition.live.channel import COMMANDS, MOST_BYTES
from instrument.closeable import Closeable

_PATIENCE_S = 0.5  # with a client that sends nothing


class CommandDesk(Closeable):
    """Answers one command a connection, from a thread of its own, until it is closed.

    `follow` carries a command out and returns the answer. The socket is open to its user alone.
    Raises `OSError` if there can be none.
    """

    def __init__(self, path: Path, follow: Callable[[str], str]) -> None:
        self._follow = follow
        self._wake, self._woken = os.pipe()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.bind(str(path))
            path.chmod(0o700)
            self._socket.listen()
        except OSError:
            self._release()
            raise
        self._thread = threading.Thread(target=self._serve, name="live commands", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Answer nothing any more; may be called twice."""
        if self._thread.is_alive():
            os.write(self._woken, b"0")
            self._thread.join()
            self._release()

    def _release(self) -> None:
        self._socket.close()
        os.close(self._wake)
        os.close(self._woken)

    def _serve(self) -> None:
        both = [self._socket.fileno(), self._wake]
        while self._wake not in select.select(both, [], [])[0]:
            with suppress(OSError):  # a client that went away
                client, _ = self._socket.accept()
                with client:
                    client.settimeout(_PATIENCE_S)
                    client.sendall(f"{self._answer(client)}\n".encode())

    def _answer(self, client: socket.socket) -> str:
        text = client.recv(MOST_BYTES).decode("ascii", "replace").strip()
        if text not in COMMANDS:
            return f"unknown command; allowed: {', '.join(COMMANDS)}"
        return self._follow(text)
