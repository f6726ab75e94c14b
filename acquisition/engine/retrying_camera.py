"""Camera that retries when the connection is lost, a bounded number of times."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

from instrument.devices import Camera, Frame
from instrument.errors import CameraLost

log = logging.getLogger(__name__)

MAX_TRIES = 4  # in each of them the camera's driver tries to reconnect for two seconds

T = TypeVar("T")


class RetryingCamera:
    """Repeats a call up to `MAX_TRIES` times; each retry is logged, and so enters the record.

    The driver restores the settings of a camera that reconnects, or raises another error. A call
    is repeated as a whole: all its frames are from one connection.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the one read back, in seconds."""
        return self._retry(lambda: self._camera.set_exposure_s(exposure_s))

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        return self._retry(lambda: self._camera.grab(count))

    def _retry(self, action: Callable[[], T]) -> T:
        for tried in range(1, MAX_TRIES):
            try:
                return action()
            except CameraLost as error:
                log.warning("%s: try %d of %d", error, tried + 1, MAX_TRIES)
        return action()
