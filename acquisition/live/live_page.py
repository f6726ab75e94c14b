"""Live page in this process: its follower and its server, over one board."""

from __future__ import annotations

import socket
from contextlib import ExitStack
from pathlib import Path

from acquisition.live.address import port_of
from acquisition.live.following.aim_follower import AimFollower
from acquisition.live.following.board import Board
from acquisition.live.following.follower import Follower
from acquisition.live.following.run_follower import RunFollower
from acquisition.live.following.run_reader import RunReader
from acquisition.live.following.scan_watch import ScanWatch
from acquisition.live.web.app import Shown, live_app
from acquisition.live.web.server import WebServer
from instrument.closeable import Closeable


class LivePage(Closeable):
    """Page of a run, or with `aiming` of the channel of a camera; served until it is closed.

    Raises `InputError` or `StorageError` where the folder is no run, or one that cannot be read.
    """

    def __init__(
        self, watched: Path, listener: socket.socket, token: str, *, aiming: bool = False
    ) -> None:
        with ExitStack() as stack:
            stack.enter_context(listener)
            board = Board()
            reader = None if aiming else stack.enter_context(RunReader(watched))
            follower = _follower(reader, watched, board)
            self._follower = stack.enter_context(follower)
            self._follower.poll()
            self._follower.start()
            shown = Shown(board, follower.scan.channel, reader)
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


def _follower(reader: RunReader | None, channel: Path, board: Board) -> Follower:
    if reader is None:
        return AimFollower(ScanWatch(channel, board), board)
    return RunFollower(reader, board)
