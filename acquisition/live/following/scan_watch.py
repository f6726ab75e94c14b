"""Watch over the scan of a run through its channel: where the rig stands, the newest picture."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition.live.channel import (
    SOCKET_FILE,
    WATCH,
    WATCH_EVERY_S,
    NoScanError,
    read_state,
    send,
)
from acquisition.live.following.board import Board
from acquisition.live.following.curves import SIGNS

_AXES = {"theta_i": "lamp", "dphi": "azimuth", "theta_r": "camera"}
_NEVER_S = -math.inf
_OLD_S = 2 * WATCH_EVERY_S  # of a state: a scan that is watched writes it twice a second
_RIG, _PICTURE = "rig", "picture"
_UNKNOWN = {"axes": [], "lamp": "unknown"}


class ScanWatch:
    """Watch over the scan that has this channel.

    `state` is what the scan published last, None without one. `answers`: a scan is there. `silent`:
    one has left its channel, and does not answer.
    """

    def __init__(self, channel: Path, board: Board) -> None:
        self.channel, self._board = channel, board
        self.state: Mapping[str, Any] | None = None
        self.answers = self.silent = False
        self._asked_s = _NEVER_S

    def poll(self) -> None:
        """Publish where the rig stands; ask for pictures while somebody looks at them."""
        if (self.channel / SOCKET_FILE).exists():
            self._ask()
        else:
            self.answers, self.silent, self._asked_s = False, False, _NEVER_S
        self.state = _fresh(read_state(self.channel)) if self.answers else None
        if self.state is None:
            self._board.put(_RIG, _RIG, _UNKNOWN)
        else:
            self._board.put(_RIG, _RIG, {"axes": _axes(self.state), "lamp": self.state["lamp"]})
        self._board.put(_PICTURE, _PICTURE, self.state and self.state["picture"])

    def _ask(self) -> None:
        """Find out whether the scan answers: it publishes for some seconds after each time."""
        now_s = time.monotonic()
        due = self._asked_s == _NEVER_S or self._board.readers > 0
        if not due or now_s - self._asked_s < WATCH_EVERY_S:
            return
        self._asked_s = now_s
        try:
            send(self.channel, WATCH)
        except NoScanError:
            self.answers, self.silent = False, True
        else:
            self.answers, self.silent = True, False


def _fresh(state: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Return a state, None for an old one: nobody was watching, and a new one follows at once."""
    if state is None:
        return None
    age = datetime.now(UTC) - datetime.fromisoformat(state["time_utc"])
    return state if abs(age.total_seconds()) < _OLD_S else None


def _axes(state: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [
        {"name": name, "label": f"{SIGNS[name]} {_AXES[name]}", **state["axes"][name]}
        for name in _AXES
        if name in state["axes"]
    ]
