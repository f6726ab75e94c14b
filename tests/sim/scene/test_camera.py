"""The simulated camera; what every camera must do is in `tests.drivers.test_camera_contract`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from instrument.config.load import Loaded
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from sim.scene.render import electrons_per_s
from sim.scene.sensor import Sensor
from tests.support.scans import exact_rig, shrunk, simulated_scene


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


def test_a_frame_of_a_moving_axis_shows_the_mean_over_its_exposure(demo: Loaded) -> None:
    """The mean of the light at many angles of the exposure, against that of its nodes."""
    loaded = replace(demo, rig=exact_rig(shrunk(demo, 10).rig))
    scene = simulated_scene(loaded, theta_r=40.0)
    scene.motions["theta_r"] = lambda time_s: 40.0 + 15.0 * time_s
    poses = scene.poses_during(0.2, 0.1)
    assert [pose["theta_r"] for pose in poses] == pytest.approx(
        43.75 + 0.75 * np.array([-(0.6**0.5), 0, 0.6**0.5])
    )
    sensor = Sensor(scene)
    image = sensor.picture(0.02, poses).astype(float)
    steps = []
    for angle in np.linspace(43.0, 44.5, 51):
        scene.true_deg["theta_r"] = float(angle)
        steps.append(electrons_per_s(scene))
    gain = 0.02 / loaded.rig.camera.electrons_per_dn
    expected = gain * np.mean(steps, axis=0) + loaded.rig.camera.black_level_dn
    assert np.mean(image - expected) == pytest.approx(0.0, abs=1.5)
    assert np.mean(image) == pytest.approx(np.mean(expected), rel=2e-3)
