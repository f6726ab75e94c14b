"""An open V4L2 camera that streams: one frame after the other, each with what is wrong with it.

OpenCV waits in whole seconds and hands out frames that the driver has flagged as bad. So the wait
is a poll() of the descriptor that OpenCV opened, and a frame's buffer is looked at before the
frame is taken: once taken, Linux no longer tells that it was flagged.
"""

from __future__ import annotations

import os
import select
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.v4l2 import ioctl as v4l2
from drivers.v4l2.controls import EXPOSURE, GAIN, Controls
from drivers.v4l2.open_device import (
    CABLE,
    buffer_count,
    lost,
    open_control,
    open_video,
)
from drivers.v4l2.settings import STEPS_PER_S, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat
from instrument.clock import Clock
from instrument.devices import Image
from instrument.errors import CameraLost, DeviceError

PATIENCE_S = 1.0  # beyond the exposure and a period; a silent camera is named after that
_STARTING_S = 2.0  # what a camera may take to its first frame
_AT_ONCE_S = 0.5  # a first grab that fails sooner has not waited: the stream did not start
_GLANCE_S, _RETRY_S = 0.1, 0.005
_SAME_STAMP_S = 2e-6
_CLOCK_SLACK_S = 0.05
_PROBES = 3


@dataclass(frozen=True, slots=True)
class Traits:
    """What was found of the camera when it was first opened.

    Its least frame period; whether its stamps are of the monotonic clock; whether its buffers tell
    of torn frames; what could not be made neutral, in words.
    """

    period_s: float
    monotonic: bool
    tells_torn: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame that has been taken: its time stamp, and what is wrong with it, if anything."""

    stamp_s: float
    fault: str = ""


class Capture:
    """Opens the camera and sets everything; `start` then lets it stream."""

    def __init__(self, settings: V4l2Settings, exposure_steps: int, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self.looks_at_buffers = True  # refuse a frame whose buffer does not show itself
        self._control = open_control(settings)
        try:
            self.capability = v4l2.capability(self._control)
            self._who = f"camera {self.capability.card} ({settings.device})"
            self._video, self._stream = open_video(settings, self._control, self._who)
        except BaseException:
            os.close(self._control)
            raise
        try:
            self._set_controls(exposure_steps)
        except BaseException:
            self.close()
            raise

    def _set_controls(self, exposure_steps: int) -> None:
        settings = self._settings
        self._controls = Controls(self._control, self._who)
        self._notes = self._controls.leave_nothing_automatic()
        span = (settings.min_exposure_s, settings.max_exposure_s)
        self._controls.check_range(EXPOSURE, *(settings.exposure_steps(s) for s in span))
        self.set_exposure(exposure_steps)
        if settings.gain is not None:
            self._controls.set(GAIN, settings.gain)
        self._buffers, self._turn = buffer_count(self._video), 0

    @property
    def settings(self) -> dict[str, str]:
        """Every control that was set, as it was read back."""
        return dict(self._controls.read_back)

    @property
    def sees_buffers(self) -> bool:
        """Whether the descriptor that OpenCV streams on was found."""
        return self._stream is not None

    def close(self) -> None:
        """Give the camera back."""
        self._video.release()
        os.close(self._control)

    def set_exposure(self, steps: int) -> None:
        """Set the exposure in steps of 100 µs and read it back."""
        self._exposure_s = self._controls.set(EXPOSURE, steps) / STEPS_PER_S

    def start(self, life: Heartbeat) -> None:
        """Start the stream; the camera's first frame may take its time."""
        began_s = self._clock.now_s()
        started = self._video.grab()
        self.check_presence()
        if not started and self._clock.now_s() - began_s < _AT_ONCE_S:
            raise CameraLost(
                f"{self._who}: the stream could not be started; look whether the camera shares its "
                "USB hub with others, and plug it in anew"
            )
        if not started:
            self.next(life, self._exposure_s + _STARTING_S)

    def traits(self, life: Heartbeat) -> Traits:
        """Start the stream and find out what the camera tells of its frames."""
        began_s = self._clock.now_s()
        self.start(life)
        found = [self.next(life, self._exposure_s + PATIENCE_S) for _ in range(_PROBES)]
        stamps = [one.stamp_s for one in found]
        periods = np.diff(stamps)
        earliest, latest = began_s - _CLOCK_SLACK_S, self._clock.now_s() + _CLOCK_SLACK_S
        monotonic = earliest <= stamps[0] and stamps[-1] <= latest and bool(np.all(periods > 0))
        told = self.sees_buffers and not all(one.fault == _UNSEEN for one in found)
        said_s = v4l2.frame_period_s(self._control) or 0.0
        measured_s = float(np.min(periods)) if monotonic else 0.0
        return Traits(max(said_s, measured_s), monotonic, told, tuple(self._notes))

    def next(self, life: Heartbeat, patience_s: float) -> Arrival:
        """Take the next frame out of the queue, old or new; a silent camera is an error."""
        deadline_s = self._clock.now_s() + patience_s
        while self._is_filled(life, deadline_s):
            filled = self._filled_buffers()
            if self._video.grab():
                life.beat()
                return self._arrival(filled)
            life.check()
            self.check_presence()  # it is there: one failed request heals by itself
            self._clock.sleep(_RETRY_S)
        self.check_presence()
        raise CameraLost(
            f"{self._who}: no frame for {patience_s:.1f} s at an exposure of {self._exposure_s:g} "
            f"s: the stream stands still; {CABLE}; the next try opens the camera anew"
        )

    def _is_filled(self, life: Heartbeat, deadline_s: float) -> bool:
        """Wait until a frame, or a failure, can be fetched; False once the deadline has passed."""
        left_s = deadline_s - self._clock.now_s()
        if self._stream is None:
            return left_s > _AT_ONCE_S  # OpenCV waits, for a whole second
        poll = select.poll()
        poll.register(self._stream, select.POLLIN)
        while left_s > 0:
            if poll.poll(1e3 * min(left_s, _GLANCE_S)):
                return True
            life.check()
            left_s = deadline_s - self._clock.now_s()
        return False

    def _filled_buffers(self) -> list[v4l2.Buffer]:
        """The filled buffers that nobody has taken yet, or the one whose turn it is.

        Buffers are filled in turn. Were it not so, the frame would not be found, but refused.
        """
        if self._stream is None:
            return []
        try:
            turn = v4l2.buffer_state(self._stream, self._turn)
            if turn.flags & v4l2.BUFFER_DONE:
                return [turn]
            states = [v4l2.buffer_state(self._stream, i) for i in range(self._buffers)]
        except OSError:
            return []  # the grab that follows fails, or its frame is refused
        return [one for one in states if one.flags & v4l2.BUFFER_DONE]

    def _arrival(self, filled: list[v4l2.Buffer]) -> Arrival:
        import cv2

        stamp_s = 1e-3 * self._video.get(cv2.CAP_PROP_POS_MSEC)
        needed = self._settings.bytes_per_line * self._settings.height_px
        for one in filled:
            if abs(one.time_s - stamp_s) < _SAME_STAMP_S:
                self._turn = (one.index + 1) % self._buffers
                return Arrival(stamp_s, _fault(one, needed))
        return Arrival(stamp_s, _UNSEEN if self.looks_at_buffers else "")

    def image(self) -> Image | None:
        """The picture of the frame taken last, in memory of its own; None: not of this size."""
        good, image = self._video.retrieve()
        if not good or image.shape != self._settings.shape:
            return None
        wide = self._settings.pixel_format in ("Y10", "Y16")
        if image.dtype != (np.uint16 if wide else np.uint8):
            return None
        luma: NDArray[Any] = image[:, :, 0] if image.ndim == 3 else image
        return luma if luma.base is None else luma.copy()

    def check_counts(self, image: Image) -> None:
        """An error when a pixel has more counts than the bit depth allows."""
        greatest = self._settings.checked_max_dn
        if greatest is None or (found := int(image.max())) <= greatest:
            return
        raise DeviceError(
            f"{self._who}: a pixel has {found} counts, {self._settings.bit_depth} bits allow "
            f"{greatest}: samples are left-aligned, or bit_depth is wrong; correct bit_depth "
            "(16 for left-aligned samples)"
        )

    def torn(self, fault: str, times: int) -> DeviceError:
        """What to say of bad frames in a series."""
        return DeviceError(
            f"{self._who}: {times} bad frames in a series, the last {fault}; {CABLE}"
        )

    def check_presence(self) -> None:
        """An error when the camera is no longer there."""
        try:
            v4l2.capability(self._control)
        except OSError as error:
            raise lost(self._who, error) from error


_UNSEEN = "was in a buffer that did not show itself"


def _fault(buffer: v4l2.Buffer, needed: int) -> str:
    if buffer.flags & v4l2.BUFFER_ERROR:
        return "was flagged as bad by the driver"
    if buffer.bytes_used < needed:
        return f"had {buffer.bytes_used} of {needed} bytes"
    return ""
