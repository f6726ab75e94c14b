"""Serial port of an emulated controller, with faults injected into its answers.

A controller is a function from received bytes to answered bytes. A wire carries both in a thread of
its own and applies the faults that a test has injected.
"""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
import tty
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from instrument.closeable import Closeable

# A driver whose stop was not confirmed opens its port again for 2 s.
_NUMBER_KEPT_S = 4.0

FaultName = Literal["drop", "delay", "late", "garbage", "truncate", "nul", "lose request", "unplug"]


class Controller(Protocol):
    """Controller on a wire; several may share one."""

    def answer(self, data: bytes) -> bytes:
        """Return the answer to the bytes just received; commands may arrive in pieces."""
        ...


@dataclass(frozen=True, slots=True)
class Fault:
    """Fault of one answer: dropped, sent after `seconds`, or corrupted.

    delay: the answer comes late but within the master's time-out. late: it comes after the master
    has given up; later answers still queue behind it. lose request: the controller never receives
    the command. unplug: the port disappears.
    """

    name: FaultName
    seconds: float = 0.0


class Wire(Closeable):
    """Passes bytes to the controllers and their answers back; subclasses implement the port.

    `seen`: time (monotonic, in s) and bytes of each message received from the master.
    `spoil_request` turns such a message into what reaches the controllers.
    """

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._controllers = tuple(controllers)
        self._faults: deque[Fault | None] = deque()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self.seen: list[tuple[float, bytes]] = []
        self.spoil_request: Callable[[bytes], bytes] = lambda data: data
        self._thread.start()

    def inject(self, *faults: Fault | None) -> None:
        """Apply these faults to the next answers, one each; None leaves an answer intact."""
        with self._lock:
            self._faults.extend(faults)

    def clear_faults(self) -> None:
        """Remove all faults not applied yet."""
        with self._lock:
            self._faults.clear()

    def received(self) -> int:
        """Return the number of bytes received from the master."""
        return sum(len(data) for _, data in self.seen)

    @property
    def pending(self) -> int:
        """Number of faults not applied yet."""
        with self._lock:
            return len(self._faults)

    def close(self) -> None:
        """Remove the port and end the thread."""
        self._closing.set()
        self._unplug()
        self._thread.join(timeout=5)

    @abstractmethod
    def _serve(self) -> None: ...

    @abstractmethod
    def _send(self, data: bytes) -> None: ...

    @abstractmethod
    def _unplug(self) -> None: ...

    def _receive(self, data: bytes) -> None:
        """Pass the master's bytes to the controllers and send their answer."""
        self.seen.append((time.monotonic(), data))
        with self._lock:
            lost = bool(self._faults) and self._faults[0] == Fault("lose request")
            if lost:
                self._faults.popleft()
        if lost:
            return
        data = self.spoil_request(data)
        answer = b"".join(controller.answer(data) for controller in self._controllers)
        if answer:
            self._send_with_fault(answer)

    def _send_with_fault(self, answer: bytes) -> None:
        with self._lock:
            fault = self._faults.popleft() if self._faults else None
        if fault is None:
            self._send(answer)
        elif fault.name == "unplug":
            self._unplug()
        elif fault.name != "drop":
            self._closing.wait(fault.seconds)
            self._send(_CORRUPT.get(fault.name, bytes)(answer))


_CORRUPT: dict[str, Callable[[bytes], bytes]] = {
    "garbage": lambda answer: bytes(0x80 | byte ^ 0x55 for byte in answer),
    "truncate": lambda answer: answer[: len(answer) // 2],
    "nul": lambda answer: b"\0\0" + answer[:3] + b"\0" + answer[3:],
}


class PtyWire(Wire):
    """Serial port on a pseudo-terminal; the master opens `port`.

    An unplugged port is gone, but no other gets its number before `close`, nor for a few seconds
    after it: a driver would send the stop that it still owes to whatever device has that number
    next.
    """

    def __init__(self, controllers: Sequence[Controller]) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._descriptors = threading.Lock()
        super().__init__(controllers)

    def send_noise(self, data: bytes) -> None:
        """Send bytes that no controller has sent."""
        self._send(data)

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                if select.select([self._master], [], [], 0.2)[0]:
                    self._receive(os.read(self._master, 4096))
            except (OSError, ValueError):
                return  # unplugged

    def _send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):  # unplugged meanwhile
            os.write(self._master, data)

    def close(self) -> None:
        """Remove the port, end the thread and, a few seconds later, give up the port's number."""
        super().close()
        if self._slave >= 0:
            giving_up = threading.Timer(_NUMBER_KEPT_S, os.close, [self._slave])
            giving_up.daemon = True
            giving_up.start()
            self._slave = -1

    def _unplug(self) -> None:
        with self._descriptors:
            self._master = _closed(self._master)


def _closed(descriptor: int) -> int:
    """Close a descriptor, -1 for none; return -1."""
    if descriptor >= 0:
        os.close(descriptor)
    return -1
