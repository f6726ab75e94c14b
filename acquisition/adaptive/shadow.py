"""Work that is done while the rig moves: one task at a time, in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Result = TypeVar("Result")


class Shadow(Generic[Result]):
    """Task that has been begun; `result` waits for it."""

    def __init__(self, task: Callable[[], Result]) -> None:
        self._task = task
        self._found: list[Result] = []
        self._error: BaseException | None = None
        # A scan that ends does not wait for it.
        self._thread = threading.Thread(target=self._work, name="choice", daemon=True)
        self._thread.start()

    def result(self) -> Result:
        """Return what the task returned; raise what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._found[0]

    def _work(self) -> None:
        try:
            self._found.append(self._task())
        except BaseException as error:  # noqa: BLE001 - it is raised where the result is asked for
            self._error = error
