"""Event loop of asyncio in a thread of its own, for devices that only work in one."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine
from typing import Any, TypeVar

from instrument.closeable import Closeable
from instrument.errors import DeviceError

T = TypeVar("T")
_ENDS_WITHIN_S = 2.0


class EventLoop(Closeable):
    """Runs coroutines for callers in any thread; `who` names the device in errors."""

    def __init__(self, who: str) -> None:
        self._who, self._loop = who, asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, name=f"{who} loop", daemon=True)
        self._thread.start()

    def run(self, what: str, coroutine: Coroutine[Any, Any, T], within_s: float) -> T:
        """Return the result of a coroutine.

        Raises `DeviceError` with its error, or if it has not ended `within_s` seconds.
        """
        if not self._thread.is_alive():
            coroutine.close()
            raise DeviceError(f"{self._who}: {what}: its connection is closed")
        future = asyncio.run_coroutine_threadsafe(coroutine, self._loop)
        try:
            error = future.exception(within_s)
        except TimeoutError:
            future.cancel()
            raise DeviceError(
                f"{self._who}: {what}: no answer within {within_s:g} s: look at its controller and "
                "at the network"
            ) from None
        if error is not None:
            why = f"{type(error).__name__}: {error}"
            raise DeviceError(f"{self._who}: {what}: {why}: look at its controller") from error
        return future.result()

    def close(self) -> None:
        """End the thread; may be called twice."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_ENDS_WITHIN_S)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_forever()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())
        self._loop.close()
