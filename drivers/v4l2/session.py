"""A camera from one opening to its loss: what it is set to, and which of its frames count."""

from __future__ import annotations

import logging
from dataclasses import replace

from drivers.v4l2 import ioctl as v4l2
from drivers.v4l2.capture import PATIENCE_S, Capture, Traits
from drivers.v4l2.frame_filter import FrameFilter
from drivers.v4l2.settings import STEPS_PER_S, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat
from instrument.clock import Clock
from instrument.devices import Frame

log = logging.getLogger(__name__)

MOST_REFUSED = 3  # bad frames in a series
EXTRA_FRAMES = 2  # dropped beyond the buffers where time stamps are of no use


class Session:
    """Opens the camera, sets it, starts its stream. `traits`: what an earlier session found."""

    def __init__(
        self,
        settings: V4l2Settings,
        exposure_steps: int,
        traits: Traits | None,
        clock: Clock,
        life: Heartbeat,
    ) -> None:
        self._settings, self._clock, self._steps = settings, clock, exposure_steps
        self._capture = Capture(settings, exposure_steps, clock)
        try:
            if traits is None:
                traits = self._capture.traits(life)
            else:
                self._capture.start(life)
            life.check()  # nobody would close what nobody waited for
        except BaseException:
            self._capture.close()
            raise
        looks = traits.tells_torn and self._capture.sees_buffers
        self.traits = replace(traits, tells_torn=looks)
        self._capture.looks_at_buffers = looks
        self._gate = self._new_gate(traits)

    def _new_gate(self, traits: Traits) -> FrameFilter:
        settings = self._settings
        uncounted = None if traits.monotonic else settings.buffers + EXTRA_FRAMES
        late = settings.exposure_delay_frames
        return FrameFilter(self.exposure_s, traits.period_s, late, uncounted)

    @property
    def capability(self) -> v4l2.Capability:
        """Who answered."""
        return self._capture.capability

    @property
    def settings(self) -> dict[str, str]:
        """What the camera says that it is set to, and how often it takes a frame."""
        return {**self._capture.settings, "frame period": f"{self.traits.period_s:g} s"}

    @property
    def exposure_s(self) -> float:
        """The exposure that was read back last."""
        return self._steps / STEPS_PER_S

    @property
    def longest_frame_s(self) -> float:
        """What the next frame may take."""
        return self._gate.longest_exposure_s + self.traits.period_s

    def close(self) -> None:
        """Give the camera back."""
        self._capture.close()

    def set_exposure(self, steps: int) -> float:
        """Set the exposure in steps of 100 µs and return the one read back, in seconds."""
        self._capture.set_exposure(steps)
        if steps != self._steps:
            self._steps = steps
            self._gate.exposure_changed(self._clock.now_s(), self.exposure_s)
        return self.exposure_s

    def take(self, life: Heartbeat, count: int, called_s: float) -> list[Frame]:
        """Take `count` good frames that began after `called_s`."""
        self._gate.call(called_s)
        frames: list[Frame] = []
        refused = 0
        while len(frames) < count:
            arrival = self._capture.next(life, self.longest_frame_s + PATIENCE_S)
            if not self._gate.admits(arrival.stamp_s):
                continue
            frame, fault = self._frame(arrival.stamp_s, arrival.fault)
            if frame is None:
                refused += 1
                if refused > MOST_REFUSED:
                    raise self._capture.torn(fault, refused)
                log.warning("camera %s: a frame %s: taken anew", self._settings.device, fault)
                continue
            frames.append(frame)
            refused = 0
        return frames

    def _frame(self, stamp_s: float, fault: str) -> tuple[Frame | None, str]:
        """The frame that was taken last, or what is wrong with it."""
        image = None if fault else self._capture.image()
        if image is None:
            return None, fault or "was of another size"
        self._capture.check_counts(image)
        device_time_s = stamp_s if self.traits.monotonic else None
        return Frame(image, self.exposure_s, self._clock.now_s(), device_time_s), ""
