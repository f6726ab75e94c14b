"""Work on many items by a Dask cluster: Dask hands out the items and repeats those that are lost.

Dask is an extra, imported only here.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from acquisition.batch.lost import Lost
from instrument.errors import DeviceError, InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

ANSWER_S = 5  # time allowed for a scheduler to answer


def connected(address: str) -> Any:
    """Return the client of the scheduler at an address such as `tcp://host:8786`.

    Raises `InputError` where Dask is not installed or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--scheduler needs Dask, which this Python does not have: pip install 'gonio[cluster]'"
        ) from None
    try:
        return Client(address, timeout=ANSWER_S)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there ({_short(error)}); allowed: "
            "the address that `dask scheduler` prints, such as tcp://127.0.0.1:8786"
        ) from None


def worker_count(client: Any) -> int:
    """Return the number of workers that the cluster has now."""
    return len(client.scheduler_info(n_workers=-1)["workers"])


def on_cluster(
    work: Callable[[Item], Result], items: Sequence[Item], client: Any
) -> Generator[tuple[Item, Result | Lost], None, None]:
    """Yield each item with its result, in the order in which they are done.

    `work`: a function of a module that all workers have. Closing the iterator, or the client, takes
    back what has not begun. Raises `DeviceError` where the scheduler is lost.
    """
    from distributed import KilledWorker, as_completed

    waiting = {client.submit(work, item, pure=False): item for item in items}
    try:
        for future in as_completed(list(waiting)):
            item = waiting.pop(future)
            if future.status == "cancelled":
                raise DeviceError(
                    "the Dask scheduler is gone: look at it, and run the command again"
                )
            result: Result | Lost
            try:
                result = future.result()
            except KilledWorker as error:
                result = Lost(f"its workers ended each time: {_short(error)}")
            future.release()
            yield item, result
    finally:
        with suppress(OSError):  # the scheduler is gone, and what waits with it
            client.cancel(list(waiting))


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
