"""What an emulated controller hangs on, a pseudo-terminal or a TCP port, and what goes wrong there.

A controller turns the bytes that reach it into the bytes that it answers, by itself; a wire carries
both, in a thread, and does to the answers what a test has asked for.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time
import tty
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from instrument.closeable import Closing

FaultName = Literal["drop", "delay", "late", "garbage", "truncate", "nul", "lose request", "unplug"]


class Controller(Protocol):
    """A controller on a wire; several may share one."""

    def answer(self, data: bytes) -> bytes:
        """What it sends once these bytes have reached it; commands may come in pieces."""
        ...


@dataclass(frozen=True, slots=True)
class Fault:
    """What happens to one answer: it is dropped, comes after `seconds`, is not what it should be.

    `delay` holds everything up, as a slow controller does; `late` lets later answers overtake
    nothing either, but the master has given up by then. `lose request`: the controller never gets
    the bytes. `unplug`: the port vanishes.
    """

    name: FaultName
    seconds: float = 0.0


class _Wire(Closing):
    """Feeds the controllers and spoils their answers. Subclasses carry the bytes."""

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._controllers = tuple(controllers)
        self._faults: deque[Fault | None] = deque()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self.seen: list[tuple[float, bytes]] = []
        self._thread.start()

    def inject(self, *faults: Fault | None) -> None:
        """Spoil the next answers, one by one; None leaves one whole."""
        with self._lock:
            self._faults.extend(faults)

    def heal(self) -> None:
        """Spoil nothing any more."""
        with self._lock:
            self._faults.clear()

    @property
    def pending(self) -> int:
        """Faults that have not happened yet."""
        with self._lock:
            return len(self._faults)

    def close(self) -> None:
        """Take the wire away."""
        self._closing.set()
        self._unplug()
        self._thread.join(timeout=5)

    @abstractmethod
    def _serve(self) -> None: ...

    @abstractmethod
    def _send(self, data: bytes) -> None: ...

    @abstractmethod
    def _unplug(self) -> None: ...

    def _arrived(self, data: bytes) -> None:
        """Pass on what the master sent, and answer."""
        self.seen.append((time.monotonic(), data))
        with self._lock:
            losing = bool(self._faults) and self._faults[0] == Fault("lose request")
            if losing:
                self._faults.popleft()
        if losing:
            return
        answer = b"".join(controller.answer(data) for controller in self._controllers)
        if answer:
            self._spoiled(answer)

    def _spoiled(self, answer: bytes) -> None:
        with self._lock:
            fault = self._faults.popleft() if self._faults else None
        if fault is None:
            self._send(answer)
        elif fault.name == "unplug":
            self._unplug()
        elif fault.name != "drop":
            self._closing.wait(fault.seconds)
            self._send(_SPOILT.get(fault.name, bytes)(answer))


_SPOILT: dict[str, Callable[[bytes], bytes]] = {
    "garbage": lambda answer: bytes(0x80 | byte ^ 0x55 for byte in answer),
    "truncate": lambda answer: answer[: len(answer) // 2],
    "nul": lambda answer: b"\0\0" + answer[:3] + b"\0" + answer[3:],
}


class PtyWire(_Wire):
    """A serial port: the master opens `port`."""

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._open = threading.Lock()
        super().__init__(controllers)

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                if select.select([self._master], [], [], 0.2)[0]:
                    self._arrived(os.read(self._master, 4096))
            except (OSError, ValueError):
                return  # unplugged

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._master, data)
        except OSError:
            return  # unplugged meanwhile

    def _unplug(self) -> None:
        with self._open:
            for descriptor in (self._master, self._slave):
                if descriptor >= 0:
                    os.close(descriptor)
            self._master = self._slave = -1


class TcpWire(_Wire):
    """A gateway: the master connects to `host` and `port`."""

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
                with self._peer as peer:  # one that hangs up is closed before the next
                    while data := peer.recv(4096):
                        self._arrived(data)
            except OSError:
                continue  # unplugged, or the master has gone

    def _send(self, data: bytes) -> None:
        if self._peer is not None:
            try:
                self._peer.sendall(data)
            except OSError:
                return  # the master has gone

    def _unplug(self) -> None:
        for end in (self._peer, self._listener):
            if end is not None:
                with contextlib.suppress(OSError):  # not connected
                    end.shutdown(socket.SHUT_RDWR)
                end.close()
