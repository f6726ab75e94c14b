"""Follower of a run: its record and its scan become messages on the board."""

from __future__ import annotations

import sqlite3

from acquisition.engine.resume import Progress
from acquisition.live.channel import channel_of
from acquisition.live.following.board import Board
from acquisition.live.following.curves import Curves
from acquisition.live.following.follower import Follower
from acquisition.live.following.messages import (
    PointMessages,
    event_contents,
    run_content,
)
from acquisition.live.following.model_thread import ModelThread
from acquisition.live.following.run_reader import RunReader
from acquisition.live.following.scan_end import ScanState, scan_state
from acquisition.live.following.scan_watch import ScanWatch
from acquisition.plan.plan import make_plan
from acquisition.plan.recorded_choice import with_recorded_choice
from acquisition.plan.step_count import StepCount
from acquisition.results.reduction import reduced_rows
from instrument.errors import GonioError
from instrument.record.reading import Rows

_LAST_FIT_S = 2.0
_EMPTY = Rows((), (), ())


class RunFollower(Follower):
    """Follower of one run, complete or not. `poll` may be called in place of `start`."""

    def __init__(self, reader: RunReader, board: Board) -> None:
        super().__init__(ScanWatch(channel_of(reader.record_file), board), board)
        self._reader = reader
        loaded = reader.loaded
        self._plan = make_plan(loaded)
        self._curves = Curves.of(self._plan)
        steps = self._plan.steps
        kept = loaded.protocol.keep_frames
        pictures = frozenset(step.index for step in steps if kept or step.preview)
        self._points = PointMessages(loaded, self._curves, pictures)
        self._models = ModelThread(board, loaded, self._curves)
        self._rows, self._elapsed_s = _EMPTY, 0.0
        self._count = StepCount(self._plan, ())
        self._trouble, self._over = "", False

    def poll(self) -> None:
        """Look once, and put on the board what is new."""
        self.scan.poll()
        try:
            rows = self._reader.changed_rows()
            if rows is not None:
                self._trouble = ""
                self._put_rows(rows)
        except (GonioError, OSError, sqlite3.Error, ArithmeticError, ValueError) as error:
            self._trouble = f"The record cannot be read: {error}"
        self._put_state(ScanState("lost", self._trouble) if self._trouble else self._state())

    def finish(self) -> None:
        """Look for the last time, and fit once more: what was measured is complete."""
        self._over = True
        super().finish()
        self._models.finish(_LAST_FIT_S)

    def close(self) -> None:
        """End the threads; may be called twice."""
        super().close()
        self._models.close()

    def _put_rows(self, rows: Rows) -> None:
        reader, board = self._reader, self._board
        if reader.loaded.protocol.goal is not None:
            self._plan = with_recorded_choice(self._plan, rows.events)
        folder = str(reader.folder or reader.record_file.parent)
        content = run_content(reader.loaded, self._plan, self._curves, folder, reader.started_utc)
        board.put("run", "run", content)
        reduced = reduced_rows(rows, reader.loaded)
        for step, point in self._points.of(rows, reduced):
            board.put(f"point {step}", "point", point)
        for event in event_contents(rows):
            board.put(f"event {event['number']}", "happened", event)
        progress = Progress.of_rows(rows)
        self._elapsed_s = progress.elapsed_s
        self._count = StepCount(self._plan, progress.done)
        if rows.readings != self._rows.readings or rows.checks != self._rows.checks:
            self._models.offer(reduced, last=self._complete)
        self._rows = rows

    @property
    def _complete(self) -> bool:
        return self._count.accepted == self._count.total and not self._plan.growing

    def _state(self) -> ScanState:
        return scan_state(
            self.scan,
            self._rows.events,
            self._reader.folder,
            complete=self._complete,
            over=self._over,
        )

    def _put_state(self, state: ScanState) -> None:
        self.put_progress(**state._asdict(), count=self._count, elapsed_s=self._elapsed_s)
