"""Stream of server-sent events: what a browser has missed, then what comes.

A browser that does not read leaves its stream waiting for the socket (uvicorn's flow control), and
holds up nothing else.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from acquisition.live.following.board import Board

HEARTBEAT_S = 5.0  # by which a connection that is gone is noticed
_MOST_BYTES = 32 * 1024  # in one go
_RETRY = b"retry: 1000\n\n"  # ms until a browser that has lost the connection tries again
_RESET = b"event: reset\ndata: {}\n\n"
_HEARTBEAT = b": still here\n\n"


async def event_stream(board: Board, last_id: str | None) -> AsyncIterator[bytes]:
    """Yield the events after the one with this id; all, after `reset`, if it is of another page.

    Ends once the board is closed and everything has been sent.
    """
    number = board.position(last_id)
    yield _RETRY if number is not None else _RETRY + _RESET
    last = number or 0
    changed, loop = asyncio.Event(), asyncio.get_running_loop()
    with board.told(lambda: _wake(loop, changed)):
        while True:
            changed.clear()
            closed = board.closed
            messages = board.after(last, _MOST_BYTES)
            if messages:
                last = messages[-1].number
                yield b"".join(message.text for message in messages)
            elif closed:
                return
            elif not await _wait(changed):
                yield _HEARTBEAT


def _wake(loop: asyncio.AbstractEventLoop, changed: asyncio.Event) -> None:
    if not loop.is_closed():
        loop.call_soon_threadsafe(changed.set)


async def _wait(changed: asyncio.Event) -> bool:
    """Wait for a change; return False after the time of a heartbeat."""
    try:
        async with asyncio.timeout(HEARTBEAT_S):
            await changed.wait()
    except TimeoutError:
        return False
    return True
