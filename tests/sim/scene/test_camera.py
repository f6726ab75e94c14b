"""The simulated camera; what every camera must do is in `tests.drivers.test_camera_contract`."""

from __future__ import annotations

import pytest

from instrument.config.load import Loaded
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from tests.support.scans import simulated_scene


def test_an_exposure_outside_the_rig_file_s_range_is_refused(demo: Loaded) -> None:
    camera = SimulatedCamera(simulated_scene(demo), SimulatedClock())
    with pytest.raises(DeviceError, match=r"exposure 9 s asked for; allowed: 0\.0005 to 2 s"):
        camera.set_exposure_s(9.0)


def test_a_frame_takes_exposure_and_read_out_in_simulated_time(demo: Loaded) -> None:
    clock = SimulatedClock()
    camera = SimulatedCamera(simulated_scene(demo), clock)
    exposure_s = camera.set_exposure_s(0.5)
    frames = camera.grab(2)
    frame_s = exposure_s + demo.rig.camera.frame_overhead_s
    assert [frame.time_s for frame in frames] == pytest.approx([frame_s, 2 * frame_s])
    assert clock.now_s() == frames[-1].time_s
