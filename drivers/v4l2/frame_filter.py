"""Which frames count: those whose exposure began after the call, at the exposure set.

A camera runs freely into a few buffers, so the first frames that it hands out are old. A frame's
time stamp, of the monotonic clock, is at the start or at the end of its exposure or read-out; one
that is an exposure and a frame period later than the call has begun after the call either way.
"""

from __future__ import annotations


class FrameFilter:
    """Told of calls, of changes of the exposure, and of every frame in the order they come.

    `period_s` is the frame period at the shortest exposure: no read-out takes longer. Where the
    stamps are of another clock, `uncounted_frames` are dropped at each call instead.
    """

    def __init__(
        self, exposure_s: float, period_s: float, delay_frames: int, uncounted_frames: int | None
    ) -> None:
        self._exposure_s, self._period_s = exposure_s, period_s
        self._delay_frames, self._uncounted_frames = delay_frames, uncounted_frames
        self._changed_s = float("-inf")
        self._old_exposure_s = exposure_s
        self._settled = False
        self._late_frames = delay_frames
        self._since_s = float("-inf")
        self._to_drop = 0

    @property
    def longest_exposure_s(self) -> float:
        """Of the frames that may be on their way."""
        return self._exposure_s if self._settled else max(self._exposure_s, self._old_exposure_s)

    def exposure_changed(self, now_s: float, exposure_s: float) -> None:
        """The camera has taken a new exposure at `now_s`; frames under way have the old one."""
        self._old_exposure_s = self.longest_exposure_s
        self._exposure_s, self._changed_s = exposure_s, now_s
        self._late_frames, self._settled = self._delay_frames, False

    def call(self, now_s: float) -> None:
        """Frames are asked for at `now_s`: none that began earlier counts."""
        self._since_s = max(now_s + self._exposure_s + self._period_s, self._begun_since_s)
        self._to_drop = (self._uncounted_frames or 0) + self._late_frames

    @property
    def _begun_since_s(self) -> float:
        """Frames with this time stamp or a later one began after the exposure was changed."""
        return self._changed_s + self._old_exposure_s + self._period_s

    def admits(self, stamp_s: float) -> bool:
        """Whether the frame with this time stamp counts. Ask once for each frame."""
        if self._uncounted_frames is None:
            admitted = self._admits_by_stamp(stamp_s)
        else:
            admitted = self._admits_by_number()
        self._settled = self._settled or admitted
        return admitted

    def _admits_by_stamp(self, stamp_s: float) -> bool:
        if not self._late_frames:
            return stamp_s >= self._since_s
        if stamp_s >= self._begun_since_s:
            self._late_frames -= 1
        return False

    def _admits_by_number(self) -> bool:
        if self._to_drop:
            self._to_drop -= 1
            return False
        self._late_frames = 0
        return True
