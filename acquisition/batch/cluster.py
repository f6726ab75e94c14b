"""Work on many items by a Dask cluster: Dask hands out the items and repeats those that are lost.

Dask is an extra, imported only here.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from acquisition.batch.lost import Lost
from instrument.errors import DeviceError, InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

ANSWER_S = 5  # time allowed for a scheduler to answer
_GONE = "the Dask scheduler is gone: look at it, and run the command again"


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
    for name in ("distributed", "distributed.client"):  # what they log is told by our errors
        logging.getLogger(name).setLevel(logging.CRITICAL)
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

    Dask blames all that a worker had when it ended: items that are lost so are worked on again, one
    at a time. `work`: a function of a module that all workers have. Closing the iterator, or the
    client, takes back what has not begun. Raises `DeviceError` where the scheduler is lost.
    """
    blamed = list[Item]()
    for item, result in _at_once(work, items, client):
        if isinstance(result, Lost):
            blamed.append(item)
        else:
            yield item, result
    for item in blamed:
        yield from _at_once(work, [item], client)


def _at_once(
    work: Callable[[Item], Result], items: Sequence[Item], client: Any
) -> Generator[tuple[Item, Result | Lost], None, None]:
    """Yield each item with its result; all of them are handed over at once."""
    waiting: dict[Any, Item] = {}
    try:
        waiting.update({client.submit(work, item, pure=False): item for item in items})
        yield from _results(waiting)
    except Exception as error:
        if client.status == "running":
            raise
        raise DeviceError(_GONE) from error
    finally:
        with suppress(OSError):  # the scheduler is gone, and what waits with it
            client.cancel(list(waiting))


def _results(waiting: dict[Any, Item]) -> Iterator[tuple[Item, Any]]:
    """Yield results as they are done, and remove their futures from `waiting`.

    A result that is lost with its worker before it was fetched is computed again, and waited for.
    """
    from distributed import CancelledError, KilledWorker, as_completed

    for future in as_completed(list(waiting)):
        item = waiting.pop(future)
        try:
            result = future.result()
        except KilledWorker as error:
            result = Lost(f"its workers ended each time: {_short(error)}")
        except CancelledError as error:  # with the connection
            raise DeviceError(_GONE) from error
        future.release()
        yield item, result


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
