"""Retrying camera: a lost connection is tried again, a bounded number of times."""

from __future__ import annotations

import pytest

from acquisition.engine.retrying_camera import MAX_TRIES, RetryingCamera
from instrument.devices import Frame
from instrument.errors import CameraLost, DeviceError


class Failing:
    """A camera that fails some calls before it answers."""

    def __init__(self, failures: int, error: type[DeviceError] = CameraLost) -> None:
        self.failures, self.error, self.calls = failures, error, 0

    def grab(self, count: int) -> list[Frame]:  # noqa: ARG002 - the camera's interface
        self.calls += 1
        if self.calls <= self.failures:
            raise self.error("camera: gone")
        return []


def test_a_camera_that_reconnects_is_used_and_every_retry_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    camera = Failing(MAX_TRIES - 1)
    assert RetryingCamera(camera).grab(3) == []  # type: ignore[arg-type]  # a stand-in
    assert caplog.messages == [f"camera: gone: try {n} of 4" for n in (2, 3, 4)]


@pytest.mark.parametrize(("error", "calls"), [(CameraLost, MAX_TRIES), (DeviceError, 1)])
def test_a_camera_that_stays_lost_or_fails_otherwise_ends_the_scan(
    error: type[DeviceError], calls: int
) -> None:
    camera = Failing(99, error)
    with pytest.raises(error, match="gone"):
        RetryingCamera(camera).grab(3)  # type: ignore[arg-type]  # a stand-in
    assert camera.calls == calls
