"""Work on many items by processes of this computer, one item at a time each.

Imports nothing heavy: each process imports this module before it knows what to work on. The
processes are spawned, not forked: a fork copies the locks of native libraries, but not the threads
that would release them.
"""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

from acquisition.batch.lost import Lost

Item = TypeVar("Item")
Result = TypeVar("Result")

_OF_TERMINAL = (signal.SIGINT, signal.SIGQUIT, signal.SIGHUP)  # reach all processes of a terminal
_TWICE = (
    "its process was ended from outside twice, as a system short of memory does: free memory, or "
    "have fewer sources worked on at a time, as with --workers 1"
)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def on_processes(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Generator[tuple[Item, Result | Lost], None, None]:
    """Yield each item with its result, in the order in which they are done.

    `work`: a function of a module. An item whose process ends is worked on again, alone, so that it
    takes no other with it; after a second time it is `Lost`. Closing the iterator ends the
    processes at once.
    """
    waiting = deque(items)
    while waiting:
        running: dict[Future[Result], Item] = {}
        # Where a process ends, `running` tells which items that concerns.
        with suppress(BrokenProcessPool), _pool(min(workers, len(waiting))) as pool:
            yield from _results(pool, work, waiting, running, workers)
        for item in running.values():
            yield item, _alone(work, item)


def _results(
    pool: ProcessPoolExecutor,
    work: Callable[[Item], Result],
    waiting: deque[Item],
    running: dict[Future[Result], Item],
    workers: int,
) -> Iterator[tuple[Item, Result]]:
    """Yield results; an item moves from `waiting` to `running` as a process gets free.

    Raises `BrokenProcessPool` where a process ended.
    """
    while waiting or running:
        while waiting and len(running) < workers:
            running[pool.submit(work, waiting[0])] = waiting[0]
            waiting.popleft()
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            result = future.result()
            yield running.pop(future), result


def _alone(work: Callable[[Item], Result], item: Item) -> Result | Lost:
    with _pool(1) as pool:
        try:
            return pool.submit(work, item).result()
        except BrokenProcessPool:
            return Lost(_TWICE)


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Pool whose processes end at once if the block is left by an exception, or if this one ends.

    They watch a pipe of which only this process has the other end.
    """
    context = get_context("spawn")
    lifeline, end = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(workers, context, _begin, (lifeline,))
    try:
        yield pool
    except BaseException:
        end.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        end.close()
        lifeline.close()


def _begin(lifeline: Connection) -> None:
    """Leave signals of the terminal to the main process, and follow its end."""
    for number in _OF_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()


def _end_with(lifeline: Connection) -> None:
    lifeline.poll(None)  # nothing is ever sent: it returns when the other end is closed
    os._exit(1)
