"""Thread that fits what has been measured so far, on a small share of one processor core."""

from __future__ import annotations

import threading
import time

from acquisition.live.following.board import Board
from acquisition.live.following.curves import Curves
from acquisition.live.following.model_line import model_content
from acquisition.results.reduction import Reduced
from instrument.closeable import Closeable
from instrument.config.load import Loaded

SHARE = 0.05  # of one core, on average: a scan has the machine
MODEL = "model"


class ModelThread(Closeable):
    """Thread that puts the best model on the board; points never wait for it."""

    def __init__(self, board: Board, loaded: Loaded, curves: Curves, share: float = SHARE) -> None:
        self._board, self._loaded, self._curves, self._share = board, loaded, curves, share
        self._wanted = threading.Condition()
        self._newest: Reduced | None = None
        self._busy = self._hurry = self._closed = False
        threading.Thread(target=self._work, name="model", daemon=True).start()

    def offer(self, reduced: Reduced, *, last: bool = False) -> None:
        """Have these points fitted in their turn; they replace earlier ones that still wait.

        `last`: no more will come, so they are fitted at once.
        """
        with self._wanted:
            self._newest, self._hurry = reduced, last
            self._wanted.notify_all()

    def finish(self, limit_s: float) -> None:
        """Fit what still waits at once, and wait for it: the scan is over.

        limit_s: of processor time of this process, as a busy machine leaves it a small share; of
        real time 30 times as long.
        """
        end_s, used_s = time.monotonic() + 30 * limit_s, time.process_time() + limit_s
        with self._wanted:
            self._hurry = True
            self._wanted.notify_all()
            while (left_s := used_s - time.process_time()) > 0 and time.monotonic() < end_s:
                if self._wanted.wait_for(self._idle, left_s):
                    break

    def _idle(self) -> bool:
        return self._newest is None and not self._busy

    def close(self) -> None:
        """End the thread, after the fit that is under way; does not wait for it."""
        with self._wanted:
            self._closed = True
            self._wanted.notify_all()

    def _work(self) -> None:
        while (reduced := self._next()) is not None:
            begun_s = time.thread_time()
            self._board.put(MODEL, MODEL, self._content(reduced))
            used_s = time.thread_time() - begun_s
            with self._wanted:
                self._busy = False
                self._wanted.notify_all()
                pause_s = used_s * (1 / self._share - 1)
                self._wanted.wait_for(lambda: self._hurry or self._closed, pause_s)

    def _next(self) -> Reduced | None:
        """Wait for points and take them; None once the thread is to end."""
        with self._wanted:
            self._wanted.wait_for(lambda: self._newest is not None or self._closed)
            reduced, self._newest = self._newest, None
            self._busy = not self._closed
            return None if self._closed else reduced

    def _content(self, reduced: Reduced) -> dict[str, object]:
        try:
            return model_content(reduced, self._loaded, self._curves)
        except Exception as error:  # noqa: BLE001 - it is shown, and more points will come
            text = f"the fit failed: {error}"
            return {"name": None, "text": text, "verdict": None, "points": 0, "lines": []}
