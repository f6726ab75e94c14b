"""Live page of a run in this process: its follower and its server, over one board."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from pathlib import Path

from acquisition.live.address import port_of
from acquisition.live.following.board import Board
from acquisition.live.following.follower import RunFollower
from acquisition.live.following.run_reader import RunReader
from acquisition.live.web.app import Shown, live_app
from acquisition.live.web.server import WebServer
from instrument.closeable import Closeable


class LivePage(Closeable):
    """Page of a run, served until it is closed.

    Raises `InputError` or `StorageError` where the folder is no run, or one that cannot be read.
    """

    def __init__(self, run: Path, listener: socket.socket, token: str) -> None:
        with ExitStack() as stack:
            stack.enter_context(listener)
            board = Board()
            reader = stack.enter_context(RunReader(run))
            self._follower = stack.enter_context(RunFollower(reader, board))
            self._follower.poll()
            self._follower.start()
            shown = Shown(board, self._follower.channel.channel, reader)
            app = live_app(shown, token, port_of(listener))
            stack.enter_context(WebServer(app, listener))
            stack.callback(board.close)
            self._parts = stack.pop_all()

    def finish(self) -> None:
        """Send what the record holds now, and the model of it: the scan is over."""
        self._follower.finish()

    def close(self) -> None:
        """Send what is left and end; may be called twice."""
        self._parts.close()
