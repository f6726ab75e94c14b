"""Watched camera: after each series its settings are as before, its frames new and in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from acquisition.interlocks.frozen_picture import FrozenPicture
from instrument.config.camera import CameraConfig
from instrument.devices import CHANGING_SETTINGS, Camera, Frame
from instrument.errors import CameraLost, Interlock

_WRAP = 2**32  # a V4L2 sequence has 32 bits


class WatchedCamera:
    """Passes all calls on to a camera, and raises `Interlock` for a series that cannot be used.

    A camera that was lost counts its frames from 0 again.
    """

    def __init__(self, camera: Camera, config: CameraConfig) -> None:
        self._camera = camera
        self._frozen = FrozenPicture(config)
        self._expected: dict[str, str] = {}
        self._exposure_s: float | None = None
        self._sequence: int | None = None

    def identity(self) -> str:
        """Return the camera's identity."""
        return self._camera.identity()

    def settings(self) -> dict[str, str]:
        """Return the camera's settings."""
        return self._camera.settings()

    def close(self) -> None:
        """Release the camera."""
        self._camera.close()

    def set_exposure_s(self, exposure_s: float) -> float:
        """Set the exposure and return the one read back, in seconds."""
        try:
            self._exposure_s = self._camera.set_exposure_s(exposure_s)
        except CameraLost:
            self._sequence = None
            raise
        return self._exposure_s

    def grab(self, count: int) -> list[Frame]:
        """Take `count` frames and check them."""
        try:
            frames = self._camera.grab(count)
            found = self._camera.settings()
        except CameraLost:
            self._sequence = None
            raise
        self._require_settings(found)
        self._require_exposure(frames)
        self._require_order(frames)
        self._frozen.require_live(frames)
        return frames

    def expect(self, before: Mapping[str, str]) -> None:
        """Require from now on the settings `before`, of the scan's beginning, or else the present.

        Raises `Interlock` if the present ones differ already.
        """
        now = self._camera.settings()
        self._expected = {**now, **before}
        self._require_settings(now)

    def _require_settings(self, found: Mapping[str, str]) -> None:
        before = self._expected
        for name in sorted(before.keys() & found.keys() - CHANGING_SETTINGS):
            if found[name] != before[name]:
                raise _changed(
                    f"{name} reads {found[name]}, but {before[name]} when the scan began"
                )

    def _require_exposure(self, frames: Sequence[Frame]) -> None:
        for frame in frames:
            if self._exposure_s not in (None, frame.exposure_s):
                raise _changed(
                    f"exposure {frame.exposure_s:g} s, but {self._exposure_s:g} s was set"
                )

    def _require_order(self, frames: Sequence[Frame]) -> None:
        """Require that the numbers of frames rise; a gap is a frame that was dropped."""
        for number, frame in enumerate(frames, 1):
            last, now = self._sequence, frame.sequence
            self._sequence = now
            if last is None or now is None or 0 < (now - last) % _WRAP < _WRAP // 2:
                continue
            raise Interlock(
                f"frame order: frame {number} of {len(frames)} has the camera's sequence number "
                f"{now} after {last}, a later frame has a larger one: the driver sends an old "
                "frame; plug the camera in again, and look at its cable and for a newer driver"
            )


def _changed(text: str) -> Interlock:
    return Interlock(
        f"camera settings: {text}: another program or a loss of power has changed it; close that "
        "program (fuser -v /dev/video* names it) and set the camera back (v4l2-ctl --set-ctrl); a "
        "control that the rig file of a new run names is set at its beginning; the frames taken "
        "meanwhile are not used"
    )
