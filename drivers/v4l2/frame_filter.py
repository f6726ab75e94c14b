"""Filter for camera frames: accept those exposed after the request, at the exposure that was set.

A camera runs freely into a few buffers, so the first frames that it delivers are old. A frame's
time stamp, on the monotonic clock, marks the start or the end of its exposure or read-out. If it
is later than the request by an exposure and a frame period, the exposure began after the request
in either case.
"""

from __future__ import annotations


class FrameFilter:
    """Keeps track of requests, of changes of the exposure, and of every frame in order.

    `period_s` is the frame period at the shortest exposure: no read-out takes longer. A new
    exposure may take effect `delay_frames` frames late. If the time stamps are of another clock,
    `dropped_per_request` frames are dropped at each request instead of comparing stamps.
    """

    def __init__(
        self, exposure_s: float, period_s: float, delay_frames: int, dropped_per_request: int | None
    ) -> None:
        self._exposure_s, self._period_s = exposure_s, period_s
        self._delay_frames, self._dropped_per_request = delay_frames, dropped_per_request
        self._changed_s = float("-inf")
        self._old_exposure_s = exposure_s
        self._settled = False
        self._late_frames = delay_frames
        self._since_s = float("-inf")
        self._to_drop = 0

    @property
    def longest_exposure_s(self) -> float:
        """Longest exposure among the frames that may be under way, in seconds."""
        return self._exposure_s if self._settled else max(self._exposure_s, self._old_exposure_s)

    def exposure_changed(self, now_s: float, exposure_s: float) -> None:
        """Note a new exposure, set at `now_s`; frames under way have the old one."""
        self._old_exposure_s = self.longest_exposure_s
        self._exposure_s, self._changed_s = exposure_s, now_s
        self._late_frames, self._settled = self._delay_frames, False

    def request(self, now_s: float) -> None:
        """Note a request at `now_s`: frames that began earlier are rejected."""
        self._since_s = max(now_s + self._exposure_s + self._period_s, self._begun_since_s)
        self._to_drop = (self._dropped_per_request or 0) + self._late_frames

    @property
    def _begun_since_s(self) -> float:
        """Time stamp from which on frames began after the exposure was changed."""
        return self._changed_s + self._old_exposure_s + self._period_s

    def accepts(self, stamp_s: float) -> bool:
        """Return True if the frame with this time stamp counts; call once per frame."""
        if self._dropped_per_request is None:
            accepted = self._accepts_by_stamp(stamp_s)
        else:
            accepted = self._accepts_by_number()
        self._settled = self._settled or accepted
        return accepted

    def _accepts_by_stamp(self, stamp_s: float) -> bool:
        if not self._late_frames:
            return stamp_s >= self._since_s
        if stamp_s >= self._begun_since_s:
            self._late_frames -= 1
        return False

    def _accepts_by_number(self) -> bool:
        if self._to_drop:
            self._to_drop -= 1
            return False
        self._late_frames = 0
        return True
