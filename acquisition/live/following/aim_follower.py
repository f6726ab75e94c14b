"""Follower of a camera that is being aimed: the newest picture, how sharp and how bright it is."""

from __future__ import annotations

from acquisition.live.channel import AIM_EVERY_S
from acquisition.live.following.board import Board
from acquisition.live.following.follower import Follower
from acquisition.live.following.scan_watch import ScanWatch

_RUN = {
    "title": "Aiming the camera",
    "sample": "",
    "folder": "",
    "rig": "",
    "quantity": "BRDF",
    "unit": "1/sr",
    "steps": 0,
    "points": 0,
    "started_utc": "",
    "sweep": "theta_r",
    "range_deg": [0.0, 0.0],
    "aiming": True,
}
_AIM = (
    *("sharpness", "best_sharpness"),
    *("saturated_pixels", "window_saturated_pixels", "window_mean_dn", "peak_dn"),
    *("full_scale_dn", "exposure_s"),
)
_ENDED = "The camera is not being aimed any more"


class AimFollower(Follower):
    """Follower of the process that has this channel, and takes pictures for somebody to see."""

    EVERY_S = AIM_EVERY_S

    def __init__(self, scan: ScanWatch, board: Board) -> None:
        super().__init__(scan, board)
        self._begun = False
        board.put("run", "run", _RUN)

    def poll(self) -> None:
        """Look once, and put on the board what is new."""
        self.scan.poll()
        picture = None if self.scan.state is None else self.scan.state["picture"]
        if picture is not None:
            self._board.put("aim", "aim", {name: picture[name] for name in _AIM})
        self._put_progress()

    def _put_progress(self) -> None:
        self._begun = self._begun or self.scan.answers
        ended = self._begun and not self.scan.answers
        text = "" if self.scan.state is None else self.scan.state["text"]
        shown = ("finished", _ENDED) if ended else ("aiming", text)
        self.put_progress(state=shown[0], text=shown[1])
