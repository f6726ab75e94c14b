"""Stream of an open V4L2 camera: single frames, each with its time stamp and its fault.

OpenCV waits in whole seconds and returns frames that the driver has flagged as bad. Therefore the
wait is a poll() of the descriptor that OpenCV opened, and the state of a frame's buffer is read
before the frame is taken: afterwards Linux no longer shows the flag.
"""

from __future__ import annotations

import os
import select
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.v4l2 import ioctl
from drivers.v4l2.controls import EXPOSURE, GAIN, Controls
from drivers.v4l2.open_device import (
    CHECK_USB,
    buffer_count,
    camera_lost,
    open_control,
    open_video,
    require_pictures,
)
from drivers.v4l2.settings import STEPS_PER_S, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat
from instrument.clock import Clock
from instrument.devices import Image
from instrument.errors import CameraLost, DeviceError

PATIENCE_S = 1.0  # beyond the exposure and a period; a silent camera is an error after that
_STARTING_S = 2.0  # time allowed for the first frame
_AT_ONCE_S = 0.5  # a first grab that fails sooner did not wait: the stream has not started
_POLL_S, _RETRY_S = 0.1, 0.005
_SAME_STAMP_S = 2e-6
_CLOCK_SLACK_S = 0.05
_PROBE_FRAMES = 3
_NO_STATE = "was in a buffer that did not show its state"


@dataclass(frozen=True, slots=True)
class Traits:
    """Properties of the camera, measured when it was first opened.

    `period_s`: its shortest frame period. `monotonic`: its time stamps are of the monotonic clock.
    `reports_torn_frames`: the states of its buffers show bad frames. `counts_frames`: its driver
    numbers them. `notes`: controls that could not be made neutral, in words.
    """

    period_s: float
    monotonic: bool
    reports_torn_frames: bool
    counts_frames: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame that has been taken: its time stamp, its fault in words, if any, and its number.

    `sequence`: from 0 at each start of the stream; larger by more than 1 after frames that were
    dropped; None if the buffer's state is not known.
    """

    stamp_s: float
    fault: str = ""
    sequence: int | None = None


class Capture:
    """Opens the camera and applies all settings; `start` then starts the stream.

    `exposure_s`: the exposure read back when it was set last, in seconds.
    """

    def __init__(self, settings: V4l2Settings, exposure_steps: int, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self.requires_buffer_state = True  # reject frames whose buffer state is not known
        self._control = open_control(settings)
        try:
            self.capability = ioctl.capability(self._control)
            self._who = f"camera {self.capability.card} ({settings.device})"
            require_pictures(self.capability, settings.device, self._who)
            self._video, self._stream = open_video(settings, self._control, self._who)
            self.can_query_buffers = self._stream is not None
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
        self._notes = self._controls.disable_automatic()
        span = (settings.min_exposure_s, settings.max_exposure_s)
        self._controls.check_range(EXPOSURE, *(settings.exposure_steps(s) for s in span))
        self.set_exposure(exposure_steps)
        if settings.gain is not None:
            self._controls.set(GAIN, settings.gain)
        self._controls.note_others()
        self._buffers = buffer_count(self._video)
        self._next_buffer: int | None = None  # not 0: OpenCV drops the first frame of a stream

    @property
    def settings(self) -> dict[str, str]:
        """Every control that was set, as read back, and the others as found."""
        return dict(self._controls.read_back)

    def close(self) -> None:
        """Close the camera."""
        self._video.release()
        os.close(self._control)

    def set_exposure(self, steps: int) -> None:
        """Set the exposure in steps of 100 µs; `exposure_s` is the one read back."""
        self.exposure_s = self._controls.set_rounded(EXPOSURE, steps) / STEPS_PER_S

    def require_unchanged(self) -> None:
        """Raise if another program has changed a control since it was set."""
        self._controls.require_unchanged()

    def start(self, heartbeat: Heartbeat) -> None:
        """Start the stream and wait for the first frame, which may take longer than others."""
        began_s = self._clock.now_s()
        started = self._video.grab()
        self.check_presence()
        if not started and self._clock.now_s() - began_s < _AT_ONCE_S:
            raise CameraLost(
                f"{self._who}: the stream could not be started; look whether the camera shares its "
                "USB hub with others, and plug it in again"
            )
        if not started:
            self.next(heartbeat, self.exposure_s + _STARTING_S)

    def measure_traits(self, heartbeat: Heartbeat) -> Traits:
        """Start the stream and measure the properties of its frames."""
        began_s = self._clock.now_s()
        self.start(heartbeat)
        patience_s = self.exposure_s + PATIENCE_S
        arrivals = [self.next(heartbeat, patience_s) for _ in range(_PROBE_FRAMES)]
        stamps = [arrival.stamp_s for arrival in arrivals]
        periods = np.diff(stamps)
        earliest, latest = began_s - _CLOCK_SLACK_S, self._clock.now_s() + _CLOCK_SLACK_S
        monotonic = earliest <= stamps[0] and stamps[-1] <= latest and bool(np.all(periods > 0))
        shows_state = not all(arrival.fault == _NO_STATE for arrival in arrivals)
        stated_s = ioctl.frame_period_s(self._control) or 0.0
        measured_s = float(np.min(periods)) if monotonic else 0.0
        reports_torn_frames = self.can_query_buffers and shows_state
        period_s = max(stated_s, measured_s)
        numbers = [one.sequence for one in arrivals if one.sequence is not None]
        counts_frames = len(set(numbers)) == len(numbers) > 1
        notes = tuple(self._notes)
        return Traits(period_s, monotonic, reports_torn_frames, counts_frames, notes)

    def next(self, heartbeat: Heartbeat, patience_s: float) -> Arrival:
        """Take the next frame out of the queue, old or new; raise if the camera is silent."""
        deadline_s = self._clock.now_s() + patience_s
        while self._is_filled(heartbeat, deadline_s):
            filled = self._filled_buffers()
            if self._video.grab():
                heartbeat.beat()
                return self._arrival(filled)
            heartbeat.check()
            self.check_presence()  # if present, a single failed request is harmless
            self._clock.sleep(_RETRY_S)
        self.check_presence()
        raise CameraLost(
            f"{self._who}: no frame for {patience_s:.1f} s at an exposure of {self.exposure_s:g} "
            f"s: the stream stands still; {CHECK_USB}; the next attempt reopens the camera"
        )

    def _is_filled(self, heartbeat: Heartbeat, deadline_s: float) -> bool:
        """Wait until a frame or an error can be fetched; False once the deadline has passed."""
        left_s = deadline_s - self._clock.now_s()
        if self._stream is None:
            return left_s > _AT_ONCE_S  # OpenCV waits, for a whole second
        poll = select.poll()
        poll.register(self._stream, select.POLLIN)
        while left_s > 0:
            if poll.poll(1e3 * min(left_s, _POLL_S)):
                return True
            heartbeat.check()
            left_s = deadline_s - self._clock.now_s()
        return False

    def _filled_buffers(self) -> list[ioctl.Buffer]:
        """Return the filled buffers not taken yet, or only the next one if it is known and filled.

        Buffers are normally filled in order. A frame that is not in one of them is rejected.
        """
        if self._stream is None:
            return []
        try:
            if self._next_buffer is not None:
                expected = ioctl.buffer_state(self._stream, self._next_buffer)
                if expected.flags & ioctl.BUFFER_DONE:
                    return [expected]
            states = [ioctl.buffer_state(self._stream, i) for i in range(self._buffers)]
        except OSError:
            return []  # the grab that follows fails, or its frame is rejected
        return [state for state in states if state.flags & ioctl.BUFFER_DONE]

    def _arrival(self, filled: list[ioctl.Buffer]) -> Arrival:
        import cv2

        stamp_s = 1e-3 * self._video.get(cv2.CAP_PROP_POS_MSEC)
        needed = self._settings.bytes_per_line * self._settings.height_px
        for buffer in filled:
            if abs(buffer.time_s - stamp_s) < _SAME_STAMP_S:
                self._next_buffer = (buffer.index + 1) % self._buffers
                return Arrival(stamp_s, _fault(buffer, needed), buffer.sequence)
        self._next_buffer = None
        return Arrival(stamp_s, _NO_STATE if self.requires_buffer_state else "")

    def image(self) -> Image | None:
        """Return the frame taken last in counts, or None if its size is wrong.

        (height, width), or (height, width, 3) in colour: red, green, blue. The array owns its
        memory.
        """
        good, image = self._video.retrieve()
        if not good or image.shape != self._settings.shape:
            return None
        if image.dtype != (np.uint16 if self._settings.wide else np.uint8):
            return None
        if self._settings.is_colour:
            colour: NDArray[Any] = image
            swapped = self._settings.pixel_format == "BGR3"
            return np.ascontiguousarray(colour[..., ::-1]) if swapped else colour.copy()
        luma: NDArray[Any] = image[:, :, 0] if image.ndim == 3 else image
        return luma if luma.base is None else luma.copy()

    def check_counts(self, image: Image) -> None:
        """Raise if an image, (height, width) or in colour, has more counts than the bits allow."""
        greatest = self._settings.checked_max_dn
        if greatest is None or (found := int(image.max())) <= greatest:
            return
        raise DeviceError(
            f"{self._who}: a pixel has {found} counts, {self._settings.bit_depth} bits allow "
            f"{greatest}: samples are left-aligned, or bit_depth is wrong; correct bit_depth "
            "(16 for left-aligned samples)"
        )

    def bad_frames_error(self, fault: str, times: int) -> DeviceError:
        """Return the error for too many bad frames in a row."""
        return DeviceError(
            f"{self._who}: {times} bad frames in a series, the last {fault}; {CHECK_USB}"
        )

    def check_presence(self) -> None:
        """Raise if the camera is no longer there."""
        try:
            ioctl.capability(self._control)
        except OSError as error:
            raise camera_lost(self._who, error) from error


def _fault(buffer: ioctl.Buffer, needed: int) -> str:
    if buffer.flags & ioctl.BUFFER_ERROR:
        return "was flagged as bad by the driver"
    if buffer.bytes_used < needed:
        return f"had {buffer.bytes_used} of {needed} bytes"
    return ""
