"""Priority lock: urgent callers enter before all others that wait."""

from __future__ import annotations

import threading

from drivers.lines.priority_lock import PriorityLock
from tests.support.stages.waiting import wait_until


def test_an_urgent_caller_enters_before_those_that_wait() -> None:
    lock, order, waiting = PriorityLock(), [], threading.Barrier(3)

    def take(name: str, urgent: bool) -> None:
        waiting.wait()
        if urgent:
            wait_until(started.is_set)
        with lock.hold(urgent):
            order.append(name)

    started = threading.Event()
    with lock.hold():
        threads = [threading.Thread(target=take, args=("asks", False)),
                   threading.Thread(target=take, args=("stops", True))]  # fmt: skip
        for thread in threads:
            thread.start()
        waiting.wait()
        started.set()
        wait_until(lambda: lock._urgent_waiting == 1)
    for thread in threads:
        thread.join(5.0)
    assert order == ["stops", "asks"]
