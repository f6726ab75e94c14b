"""Trigger points of planned faults: at or after the n-th call of a method of a device."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Literal

When = Literal["at", "after"]
Action = Callable[[], None]


class Triggers:
    """Counter of device calls that runs the actions planned for a certain call.

    Calls are named DEVICE.METHOD and counted from 1, each name by itself; `calls` lists them all in
    order.
    """

    def __init__(self) -> None:
        self.calls: list[str] = []
        self._counts: Counter[str] = Counter()
        self._planned: defaultdict[tuple[When, str, int], list[Action]] = defaultdict(list)

    def plan(self, when: When, call: str, number: int, action: Action) -> None:
        """Run `action` just before (at) or just after call number `number` of this name."""
        self._planned[when, call, number].append(action)

    @property
    def pending(self) -> int:
        """Number of planned actions that have not run yet."""
        return sum(map(len, self._planned.values()))

    @contextmanager
    def call(self, name: str, check: Action = lambda: None) -> Iterator[None]:
        """Enclose one call of a device; `check` raises where the device cannot answer."""
        self.calls.append(name)
        self._counts[name] += 1
        number = self._counts[name]
        self._run("at", name, number)
        check()
        yield
        self._run("after", name, number)

    def _run(self, when: When, name: str, number: int) -> None:
        for action in self._planned.pop((when, name, number), ()):
            action()
