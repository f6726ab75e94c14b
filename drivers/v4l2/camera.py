"""A V4L2 camera (USB and other) as the program's camera: raw counts, fresh frames, no surprises.

Use a device path of /dev/v4l/by-id: it names the same camera after it was unplugged. All calls go
to one thread, so that a driver that hangs holds nobody; a camera that was lost is opened anew, with
all its settings, by the next call.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future, wait
from typing import TypeVar

from drivers.v4l2 import ioctl as v4l2
from drivers.v4l2.capture import Traits
from drivers.v4l2.open_device import CABLE, lost
from drivers.v4l2.session import EXTRA_FRAMES, Session
from drivers.v4l2.settings import PixelFormat, V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat, Hung, Reader
from instrument.clock import Clock
from instrument.closeable import Closing
from instrument.devices import Frame
from instrument.errors import CameraLost, DeviceError

log = logging.getLogger(__name__)

__all__ = ["PixelFormat", "V4l2Camera", "V4l2Settings"]

_OPENING_S = 20.0  # no single request of an opening takes longer, not even on a sick USB bus
_CONTROL_S = 6.0  # Linux gives a USB control five seconds
_QUIET_S = 1.7  # beyond exposure and period; the reader itself names a silent camera sooner
_CLOSING_S = 2.0
_REOPEN_S, _FIRST_PAUSE_S = 2.0, 0.1

Result = TypeVar("Result")


class V4l2Camera(Closing):
    """A camera opened, set and checked; a `with` statement or `close()` gives it back.

    It starts at its shortest exposure.
    """

    def __init__(self, settings: V4l2Settings, clock: Clock) -> None:
        self._settings, self._clock = settings, clock
        self._steps = settings.exposure_steps(settings.min_exposure_s)
        self._session: Session | None = None
        self._traits: Traits | None = None
        self._capability: v4l2.Capability | None = None
        self._closed = False
        self._reader = Reader(f"camera {settings.device}", clock)
        self._released: Future[None] = self._reader.post(lambda: None)
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Give the camera back; safe twice, and soon done even when a driver hangs."""
        if self._closed:
            return
        self._closed = True
        self._drop_session()
        wait((self._released,), _CLOSING_S)  # a thread that hangs in a driver ends with the program
        self._reader.end()

    def identity(self) -> str:
        """Card, driver and bus, the picture, and what this camera cannot tell."""
        s, found = self._settings, self._capability
        picture = f"{s.pixel_format} {s.width_px} x {s.height_px} pixels, {s.bit_depth} bit"
        who = f"{found.card} ({found.driver}, {found.bus})" if found else s.device
        return "; ".join([f"{who}, {picture}", *self._remarks()])

    def settings(self) -> dict[str, str]:
        """The picture's form, and every control as it was read back."""
        s = self._settings
        size = {"size_px": f"{s.width_px} x {s.height_px}", "bit_depth": str(s.bit_depth)}
        return {"pixel_format": s.pixel_format, **size, **self._opened().settings}

    def _remarks(self) -> list[str]:
        traits = self._traits
        if traits is None:
            return []
        remarks = list(traits.notes)
        if not traits.monotonic:
            dropped = self._settings.buffers + EXTRA_FRAMES
            remarks.append(
                f"its time stamps are of another clock: {dropped} frames dropped at each call"
            )
        if not traits.tells_torn:
            remarks.append("its driver does not tell of torn frames")
        return remarks

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure, a multiple of 100 µs, and return the one read back, in seconds."""
        steps = self._settings.exposure_steps(exposure_s)
        session = self._opened()
        read_back_s = self._do(lambda _: session.set_exposure(steps), _CONTROL_S)
        self._steps = steps
        return read_back_s

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames whose exposure began after this call."""
        called_s = self._clock.now_s()
        session = self._opened()
        quiet_s = session.longest_frame_s + _QUIET_S
        return self._do(lambda life: session.take(life, count, called_s), quiet_s)

    def _opened(self) -> Session:
        """The session; a camera that was lost is looked for, with growing pauses."""
        if self._closed:
            raise DeviceError(f"camera {self._settings.device}: is closed; open it anew")
        until_s = self._clock.now_s() + _REOPEN_S
        pause_s = _FIRST_PAUSE_S
        while self._session is None:
            try:
                self._open()
            except CameraLost as error:
                if self._clock.now_s() + pause_s > until_s:
                    raise CameraLost(f"{error} (still so after {_REOPEN_S:g} s)") from error
                log.warning("%s: looked for again", error)
                self._clock.sleep(pause_s)
                pause_s *= 2
        return self._session

    def _open(self) -> None:
        if self._released not in wait((self._released,), _FIRST_PAUSE_S).done:
            raise CameraLost(f"{self._who()}: its driver hangs; {CABLE}")
        made = (self._settings, self._steps, self._traits, self._clock)
        session = self._do(lambda life: Session(*made, life), _OPENING_S)
        self._session, self._traits = session, session.traits
        known, self._capability = self._capability, self._capability or session.capability
        if known is not None and session.capability.card != known.card:
            self._drop_session()
            raise DeviceError(
                f"camera {self._settings.device}: {session.capability.card} answers where "
                f"{known.card} did; plug that one in, and name a /dev/v4l/by-id path"
            )

    def _do(self, action: Callable[[Heartbeat], Result], quiet_s: float) -> Result:
        """Have the reader do it. After any failure the next call opens the camera anew."""
        try:
            return self._reader.call(action, quiet_s)
        except Hung:
            self._drop_session()
            raise CameraLost(
                f"{self._who()}: its driver has not answered for {quiet_s:.1f} s; {CABLE}; "
                "the next try opens the camera anew"
            ) from None
        except OSError as error:
            self._drop_session()
            raise lost(self._who(), error) from error
        except DeviceError:
            self._drop_session()
            raise

    def _drop_session(self) -> None:
        """Leave the session to the reader, which gives the camera back once it is free."""
        session, self._session = self._session, None
        self._released = self._reader.post(session.close if session else lambda: None)

    def _who(self) -> str:
        device, found = self._settings.device, self._capability
        return f"camera {found.card} ({device})" if found else f"camera {device}"
