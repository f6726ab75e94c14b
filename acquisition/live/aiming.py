"""Aiming: frames of the camera one after the other, with a measure of focus, for the live page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition.live.picture import sharpness
from acquisition.live.publisher import Publisher, Seen, State
from acquisition.measure.window import Window
from instrument.clock import Clock
from instrument.config.camera import CameraConfig
from instrument.devices import Frame

_EVERY_S = 0.2  # between two frames: faster than a lens is turned by hand
AIMING: State = {"phase": "aiming", "text": "aiming", "step": None, "axes": {}, "lamp": "unknown"}


@dataclass(slots=True, kw_only=True)
class Aiming:
    """Shows the camera's frames with their sharpness, until it is interrupted.

    `take` returns the next frame, at an exposure that suits the window. `best`: the largest
    sharpness so far, without a unit.
    """

    publisher: Publisher
    camera: CameraConfig
    window: Window
    take: Callable[[], Frame]
    clock: Clock
    best: float = 0.0

    def run(self) -> None:
        """Take and show frames until `KeyboardInterrupt`."""
        with self.publisher.published(lambda: AIMING, _nothing_to_do):
            while True:
                self.show(self.take())
                self.clock.sleep(_EVERY_S)

    def show(self, frame: Frame) -> None:
        """Show one frame with its sharpness."""
        now = sharpness(frame.image, self.camera.black_level_dn)
        self.best = max(self.best, now)
        about = {"step": None, "caption": "now", "sharpness": now, "best_sharpness": self.best}
        self.publisher.show(Seen(frame, self.window, about))


def _nothing_to_do(command: str) -> str:
    return f"{command}: no scan is under way, the camera is being aimed"
