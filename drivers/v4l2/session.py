"""One opening of a camera until it is closed or lost: its settings, and the frames that count."""

from __future__ import annotations

import logging
from dataclasses import replace

from drivers.v4l2.capture import PATIENCE_S, Arrival, Capture, Traits
from drivers.v4l2.frame_filter import FrameFilter
from drivers.v4l2.settings import BUFFERS, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat
from instrument.clock import Clock
from instrument.devices import Frame, mono_picture

log = logging.getLogger(__name__)

MAX_BAD_FRAMES = 3  # in a row
EXTRA_FRAMES = 2  # dropped beyond the buffers if the time stamps are of another clock


class Session:
    """Opens the camera, sets it and starts its stream.

    `traits` are those measured by an earlier session, if any.
    """

    def __init__(
        self,
        settings: V4l2Settings,
        exposure_steps: int,
        traits: Traits | None,
        clock: Clock,
        heartbeat: Heartbeat,
    ) -> None:
        self._settings, self._clock = settings, clock
        self._capture = Capture(settings, exposure_steps, clock)
        self.capability = self._capture.capability
        try:
            if traits is None:
                traits = self._capture.measure_traits(heartbeat)
            else:
                self._capture.start(heartbeat)
            heartbeat.check()  # after a cancel nobody else would close the camera
        except BaseException:
            self._capture.close()
            raise
        shows_state = traits.reports_torn_frames and self._capture.can_query_buffers
        self.traits = replace(traits, reports_torn_frames=shows_state)
        self._capture.requires_buffer_state = shows_state
        self._filter = FrameFilter(
            self.exposure_s,
            traits.period_s,
            settings.exposure_delay_frames,
            None if traits.monotonic else BUFFERS + EXTRA_FRAMES,
        )

    @property
    def settings(self) -> dict[str, str]:
        """The controls as read back, the frame period, and who numbers the frames."""
        numbers = "by the driver" if self.traits.counts_frames else "none"
        own = {"frame period": f"{self.traits.period_s:g} s", "frame numbers": numbers}
        return {**self._capture.settings, **own}

    @property
    def exposure_s(self) -> float:
        """The exposure read back last, in seconds."""
        return self._capture.exposure_s

    @property
    def longest_frame_s(self) -> float:
        """Longest time that the next frame may take, in seconds."""
        return self._filter.longest_exposure_s + self.traits.period_s

    def close(self) -> None:
        """Close the camera."""
        self._capture.close()

    def set_exposure(self, steps: int) -> float:
        """Set the exposure in steps of 100 µs and return the one read back, in seconds."""
        before_s = self.exposure_s
        self._capture.set_exposure(steps)
        if self.exposure_s != before_s:
            self._filter.exposure_changed(self._clock.now_s(), self.exposure_s)
        return self.exposure_s

    def take(self, heartbeat: Heartbeat, count: int, requested_s: float) -> list[Frame]:
        """Take `count` good frames whose exposure began after `requested_s`.

        Raises `Interlock` if another program has changed a control meanwhile.
        """
        self._filter.request(requested_s)
        frames: list[Frame] = []
        bad = 0
        while len(frames) < count:
            arrival = self._capture.next(heartbeat, self.longest_frame_s + PATIENCE_S)
            if not self._filter.accepts(arrival.stamp_s):
                continue
            frame, fault = self._frame(arrival)
            if frame is None:
                bad += 1
                if bad > MAX_BAD_FRAMES:
                    raise self._capture.bad_frames_error(fault, bad)
                log.warning("camera %s: a frame %s: taken again", self._settings.device, fault)
                continue
            frames.append(frame)
            bad = 0
        self._capture.require_unchanged()
        return frames

    def _frame(self, arrival: Arrival) -> tuple[Frame | None, str]:
        """Return the frame taken last, or what is wrong with it."""
        image = None if arrival.fault else self._capture.image()
        if image is None:
            return None, arrival.fault or "was of another size"
        self._capture.check_counts(image)
        device_time_s = arrival.stamp_s if self.traits.monotonic else None
        sequence = arrival.sequence if self.traits.counts_frames else None
        stamps = self.exposure_s, self._clock.now_s(), device_time_s, sequence
        if not self._settings.is_colour:
            return Frame(image, *stamps), ""
        mono = mono_picture(image, 2**self._settings.bit_depth - 1)
        return Frame(mono, *stamps, colour=image), ""
