"""Retrying camera: waited for when it is lost, with one message then and one at its return."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.engine.retrying_camera import RetryingCamera
from instrument.devices import Frame
from instrument.errors import CameraLost, DeviceError
from sim.clock import SimulatedClock


class Away:
    """A camera that is away until a time; each attempt takes a while."""

    def __init__(
        self, clock: SimulatedClock, until_s: float, error: type[DeviceError] = CameraLost
    ) -> None:
        self.clock, self.until_s, self.error, self.calls = clock, until_s, error, 0

    def grab(self, count: int) -> list[Frame]:  # noqa: ARG002 - the camera's interface
        self.calls += 1
        if self.clock.now_s() < self.until_s:
            self.clock.sleep(0.05)
            raise self.error("camera: gone")
        return []


def waiting(camera: Away, reconnect_s: float) -> RetryingCamera:
    return RetryingCamera(camera, camera.clock, reconnect_s, lambda: None)  # type: ignore[arg-type]  # a stand-in


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(away_s=st.floats(0.01, 100.0), reconnect_s=st.floats(0.0, 60.0))
def test_a_camera_is_waited_for_as_long_as_the_rig_file_says(
    caplog: pytest.LogCaptureFixture, away_s: float, reconnect_s: float
) -> None:
    caplog.clear()
    clock = SimulatedClock()
    camera = waiting(Away(clock, away_s), reconnect_s)
    if away_s <= reconnect_s - 0.1:
        assert camera.grab(3) == []
        assert away_s <= clock.now_s() < away_s + 1.1  # found within a second of its return
        assert camera.waited_s == pytest.approx(clock.now_s())
        lost, back = caplog.messages
        assert back == f"camera: back after {camera.waited_s:.1f} s, with its settings restored"
    elif away_s > reconnect_s:
        with pytest.raises(CameraLost, match=r"gone \(waited for .* s\)"):
            camera.grab(3)
        assert reconnect_s <= clock.now_s() <= reconnect_s + 0.11
        (lost,) = caplog.messages
    else:
        return  # it returns between the last two attempts
    assert lost == f"camera: gone: waiting for it for up to {reconnect_s:g} s"


def test_a_camera_that_is_there_is_asked_once(caplog: pytest.LogCaptureFixture) -> None:
    camera = Away(SimulatedClock(), 0.0)
    assert waiting(camera, 30.0).grab(1) == []
    assert (camera.calls, caplog.messages) == (1, [])


def test_another_failure_ends_the_scan_at_once() -> None:
    camera = Away(SimulatedClock(), 9.0, DeviceError)
    with pytest.raises(DeviceError, match=r"gone$"):
        waiting(camera, 30.0).grab(1)
    assert camera.calls == 1
