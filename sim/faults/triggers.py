"""When something is to happen on a simulated bench: at or after a chosen call of a device."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

When = Literal["at", "after"]
Action = Callable[[], None]


class Moments:
    """Counts the calls of all devices, from 1 each, and lets happen what was planned.

    `calls` lists them in order as DEVICE.CALL.
    """

    def __init__(self) -> None:
        self.calls: list[str] = []
        self._counts: Counter[str] = Counter()
        self._planned: defaultdict[tuple[When, str, int], list[Action]] = defaultdict(list)

    def plan(self, when: When, call: str, number: int, action: Action) -> None:
        """Let `action` happen before (at) or once (after) a call is made for that time."""
        self._planned[when, call, number].append(action)

    @property
    def left(self) -> int:
        """What was planned and has not happened."""
        return sum(map(len, self._planned.values()))

    @contextmanager
    def call(self, name: str, ready: Action = lambda: None) -> Iterator[None]:
        """A device is called; `ready` raises where it cannot answer."""
        self.calls.append(name)
        self._counts[name] += 1
        number = self._counts[name]
        self._happen("at", name, number)
        ready()
        yield
        self._happen("after", name, number)

    def _happen(self, when: When, name: str, number: int) -> None:
        for action in self._planned.pop((when, name, number), ()):
            action()
