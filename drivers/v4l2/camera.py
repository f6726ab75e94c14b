"""Camera with a V4L2 driver (USB and other): raw counts, frames exposed after the request.

Use a device path of /dev/v4l/by-id: it names the same camera after it was unplugged. All calls run
in one worker thread, so a hung driver blocks nobody. The next call reopens a camera that was lost
and restores all its settings; if it is not there, the caller may try again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import TypeVar

from drivers.lines.device_lock import DeviceLock
from drivers.v4l2 import ioctl
from drivers.v4l2.capture import Traits
from drivers.v4l2.open_device import CHECK_USB, camera_lost
from drivers.v4l2.session import EXTRA_FRAMES, Session
from drivers.v4l2.settings import BUFFERS, STEPS_PER_S, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat, Hung, WorkerThread
from instrument.clock import Clock
from instrument.closeable import Closeable
from instrument.devices import Frame
from instrument.errors import CameraLost, DeviceError

log = logging.getLogger(__name__)

_OPENING_S = 20.0  # no single request of an opening takes longer, not even on a faulty USB bus
_CONTROL_S = 6.0  # Linux gives a USB control five seconds
_SILENT_S = 1.7  # beyond exposure and period; the worker itself reports a silent camera sooner
_CLOSING_S = 2.0
_RELEASE_S = 0.1  # a driver that takes longer to close the camera hangs

Result = TypeVar("Result")


class V4l2Camera(Closeable):
    """An open camera with verified settings; it starts at its shortest exposure.

    A `with` statement or `close()` closes it.
    """

    def __init__(self, settings: V4l2Settings, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self._steps = settings.exposure_steps(settings.min_exposure_s)
        self._session: Session | None = None
        self._traits: Traits | None = None
        self._capability: ioctl.Capability | None = None
        self._closed = False
        self._lock = DeviceLock("camera", settings.device)
        self._rounded: set[int] = set()
        self._worker = WorkerThread(f"camera {settings.device}", clock)
        self._released: Future[None] = self._worker.post(lambda: None)
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the camera; safe to call twice, and quick even if a driver hangs."""
        if self._closed:
            return
        self._closed = True
        self._drop_session()
        wait((self._released,), _CLOSING_S)  # a thread hung in a driver ends with the program
        self._worker.end()
        self._lock.close()

    def identity(self) -> str:
        """Return card, driver, bus, image format, and the limitations of this camera."""
        s, found = self._settings, self._capability
        image = f"{s.pixel_format} {s.width_px} x {s.height_px} pixels, {s.bit_depth} bit"
        who = f"{found.card} ({found.driver}, {found.bus})" if found else s.device
        return "; ".join([f"{who}, {image}", *self._limitations()])

    def settings(self) -> dict[str, str]:
        """Return the image format, and every control as read back."""
        s = self._settings
        size = {"size_px": f"{s.width_px} x {s.height_px}", "bit_depth": str(s.bit_depth)}
        if s.pixel_format == "YUYV":
            size["luma_range"] = "limited" if s.limited_range else "full"
        return {"pixel_format": s.pixel_format, **size, **self._opened().settings}

    def _limitations(self) -> list[str]:
        traits = self._traits
        if traits is None:
            return []
        limitations = list(traits.notes)
        if not traits.monotonic:
            dropped = BUFFERS + EXTRA_FRAMES
            limitations.append(
                f"its time stamps are of another clock: {dropped} frames dropped at each call"
            )
        if not traits.reports_torn_frames:
            limitations.append("its driver does not report torn frames")
        return limitations

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure, a multiple of 100 µs, and return the one read back, in seconds.

        A camera may round it, by a factor of up to 1.5; this is logged once for each exposure.
        """
        steps = self._settings.exposure_steps(exposure_s)
        session = self._opened()
        read_back_s = self._call(lambda _: session.set_exposure(steps), _CONTROL_S)
        self._steps = steps
        if steps not in self._rounded and abs(read_back_s * STEPS_PER_S - steps) > 0.5:
            self._rounded.add(steps)
            text = "%s: exposure %g s asked for, the camera took %g s, which is used"
            log.warning(text, self._who(), exposure_s, read_back_s)
        return read_back_s

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        requested_s = self._clock.now_s()
        session = self._opened()
        silent_s = session.longest_frame_s + _SILENT_S
        return self._call(lambda beat: session.take(beat, count, requested_s), silent_s)

    def _opened(self) -> Session:
        """Return the session; reopen a camera that was lost, or raise `CameraLost` at once."""
        if self._closed:
            raise DeviceError(f"camera {self._settings.device}: is closed; open it again")
        return self._session or self._open()

    def _open(self) -> Session:
        if self._released not in wait((self._released,), _RELEASE_S).done:
            raise CameraLost(f"{self._who()}: its driver hangs; {CHECK_USB}")
        arguments = (self._settings, self._steps, self._traits, self._clock)
        session = self._call(lambda beat: Session(*arguments, beat), _OPENING_S)
        self._session, self._traits = session, session.traits
        known, self._capability = self._capability, self._capability or session.capability
        if known is not None and session.capability.card != known.card:
            self._drop_session()
            raise DeviceError(
                f"camera {self._settings.device}: {session.capability.card} answers where "
                f"{known.card} did; plug that one in, and name a /dev/v4l/by-id path"
            )
        return session

    def _call(self, action: Callable[[Heartbeat], Result], silent_s: float) -> Result:
        """Run in the worker thread; after a failure the next call reopens the camera."""
        try:
            return self._worker.call(action, silent_s)
        except Hung:
            self._drop_session()
            raise CameraLost(
                f"{self._who()}: its driver has not answered for {silent_s:.1f} s; {CHECK_USB}; "
                "the next attempt reopens the camera"
            ) from None
        except OSError as error:
            self._drop_session()
            raise camera_lost(self._who(), error) from error
        except DeviceError:
            self._drop_session()
            raise

    def _drop_session(self) -> None:
        """Leave the session to the worker thread, which closes it as soon as it can."""
        session, self._session = self._session, None
        self._released = self._worker.post(session.close if session else lambda: None)

    def _who(self) -> str:
        device, found = self._settings.device, self._capability
        return f"camera {found.card} ({device})" if found else f"camera {device}"
