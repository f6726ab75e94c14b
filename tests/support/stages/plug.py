"""Serial adapters: one can be pulled out and put in again under the same link, one echoes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from instrument.clock import SystemClock
from sim.emulated.wire import Controller, PtyWire


class Plug:
    """A link, as in /dev/serial/by-id, to the port of controllers while they are plugged in."""

    def __init__(self, link: Path, controller: Controller) -> None:
        self.link, self.controller = link, controller
        self._wire: PtyWire | None = None
        self.put_in()

    @property
    def wire(self) -> PtyWire:
        assert self._wire is not None
        return self._wire

    def put_in(self, controller: Controller | None = None) -> None:
        """Connect the controller, or another one in its place."""
        self._wire = PtyWire([controller or self.controller])
        self.link.symlink_to(self._wire.port)

    def pull_out(self) -> None:
        """Disconnect: the port and its link vanish."""
        self.link.unlink(missing_ok=True)
        self.wire.close()


class EventfulClock(SystemClock):
    """Clock on which something happens during the next sleep of one length, which takes no time."""

    def __init__(self, seconds: float, then: Callable[[], None] = lambda: None) -> None:
        self._seconds, self.then = seconds, then
        self._skipped_s = 0.0

    def now_s(self) -> float:
        """Return the monotonic clock, ahead by the skipped sleeps."""
        return super().now_s() + self._skipped_s

    def sleep(self, seconds: float) -> None:
        """Wait, or let the event happen."""
        if seconds != self._seconds:
            super().sleep(seconds)
            return
        self._skipped_s += seconds
        then, self.then = self.then, lambda: None
        then()


class Echoing:
    """Adapter in front of a controller; `dead`: the controller behind it has no power."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.echoes, self.dead = True, False

    def answer(self, data: bytes) -> bytes:
        echo = data if self.echoes else b""
        return echo + (b"" if self.dead else self._controller.answer(data))
