"""Follower: a thread that looks again and again, and keeps a board up to date."""

from __future__ import annotations

import threading
import time
from abc import abstractmethod
from collections.abc import Sequence

from acquisition.live.channel import SCAN_EVERY_S
from acquisition.live.following.board import Board
from acquisition.live.following.messages import rounded
from acquisition.live.following.scan_watch import ScanWatch
from acquisition.plan.step_count import StepCount
from instrument.closeable import Closeable
from instrument.text.terminal_safe import escape_control_characters

_UNWATCHED_S = 1.0  # between two looks without a browser
_FAILED = "The page has failed, the scan goes on without it; start it again with gonio watch"
_IDLE = 19.0  # time without work for each time of work: a long run takes longer to reduce


class Follower(Closeable):
    """Follower of what is measured; `scan` watches over the process that measures."""

    EVERY_S = SCAN_EVERY_S
    """Time between two looks while a browser is there, in s."""

    def __init__(self, scan: ScanWatch, board: Board) -> None:
        self.scan, self._board = scan, board
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name="follower", daemon=True)

    def put_progress(
        self,
        *,
        state: str,
        text: str,
        actions: Sequence[str] = (),
        count: StepCount | None = None,
        elapsed_s: float | None = None,
    ) -> None:
        """Put the state on the board, with how far a scan is."""
        content = {
            "done": 0 if count is None else count.accepted,
            "total": 0 if count is None else count.total,
            "elapsed_s": None if elapsed_s is None else rounded(elapsed_s),
            "left_s": None if count is None else rounded(count.left_s),
            "state": state,
            "text": escape_control_characters(text),
            "actions": list(actions),
        }
        self._board.put("progress", "progress", content)

    @abstractmethod
    def poll(self) -> None:
        """Look once, and put on the board what is new."""

    def start(self) -> None:
        """Look again and again in a thread, until `close`."""
        self._thread.start()

    def finish(self) -> None:
        """Look for the last time: what was measured is complete."""
        self._end_thread()
        self.poll()

    def close(self) -> None:
        """End the thread; may be called twice."""
        self._end_thread()

    def _end_thread(self) -> None:
        self._ended.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _work(self) -> None:
        pause_s = 0.0
        try:
            while not self._ended.wait(pause_s):
                begun_s = time.thread_time()
                self.poll()
                used_s = time.thread_time() - begun_s
                pause_s = max(self.EVERY_S if self._board.readers else _UNWATCHED_S, _IDLE * used_s)
        except Exception as error:
            self.put_progress(state="lost", text=f"{_FAILED}: {error!r}")
            raise
