"""A camera that is lost for a while: asked again, within bounds, before the scan is given up."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TypeVar

from instrument.devices import Camera, Frame
from instrument.errors import CameraLost

log = logging.getLogger(__name__)

TRIES = 4  # the camera's own driver looks for it for two seconds at each

T = TypeVar("T")


class RetryingCamera:
    """Asks up to `TRIES` times a call; each further try is logged, and so in the record.

    A camera that comes back has been set as before by its driver, or it raises another error. A
    call is made again whole: its frames are all of one opening.
    """

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the one read back, in seconds."""
        return self._patiently(lambda: self._camera.set_exposure_s(exposure_s))

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        return self._patiently(lambda: self._camera.grab(count))

    def _patiently(self, action: Callable[[], T]) -> T:
        for tried in range(1, TRIES):
            try:
                return action()
            except CameraLost as error:
                log.warning("%s: try %d of %d", error, tried + 1, TRIES)
        return action()
