"""Camera that is waited for when its connection is lost, for a bounded time."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

from instrument.clock import Clock
from instrument.devices import Camera, Frame
from instrument.errors import CameraLost

log = logging.getLogger(__name__)

_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.1, 1.0  # between attempts to reopen the camera

T = TypeVar("T")


class RetryingCamera:
    """Repeats a call for up to `reconnect_s` after the camera was lost.

    The loss is logged once and so is the return; both enter the record. The driver restores the
    settings of a camera that returns, or raises another error. A call is repeated as a whole: all
    its frames are from one connection. `waited_s`: total time without a camera. `on_retry` is
    called before each attempt.
    """

    def __init__(
        self, camera: Camera, clock: Clock, reconnect_s: float, on_retry: Callable[[], None]
    ) -> None:
        self._camera, self._clock, self._reconnect_s = camera, clock, reconnect_s
        self._on_retry = on_retry
        self.waited_s = 0.0

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the one read back, in seconds."""
        return self._retry(lambda: self._camera.set_exposure_s(exposure_s))

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        return self._retry(lambda: self._camera.grab(count))

    def _retry(self, action: Callable[[], T]) -> T:
        begun_s, waited_s = self._clock.now_s(), self.waited_s
        try:
            return action()
        except CameraLost as error:
            log.warning("%s: waiting for it for up to %g s", error, self._reconnect_s)
            lost = error
        pause_s = _FIRST_PAUSE_S
        while (left_s := begun_s + self._reconnect_s - self._clock.now_s()) > 0:
            self._clock.sleep(min(pause_s, left_s))
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
            away_s = self._clock.now_s() - begun_s
            self.waited_s = waited_s + away_s
            self._on_retry()
            try:
                result = action()
            except CameraLost as error:
                lost = error
                continue
            log.warning("camera: back after %.1f s, with its settings restored", away_s)
            return result
        raise CameraLost(f"{lost} (waited for {self._reconnect_s:g} s)") from lost
