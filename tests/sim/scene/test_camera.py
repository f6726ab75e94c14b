"""The simulated camera; what every camera must do is in `tests.drivers.test_camera_contract`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from instrument.config.load import Loaded
from instrument.devices import TRUSTED_SHARE
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


def test_a_colour_camera_shows_green_as_its_picture_and_no_saturated_pixel_as_sound(
    demo: Loaded,
) -> None:
    loaded = replace(demo, rig=shrunk(demo, 10).rig)
    camera = loaded.rig.camera.model_copy(update={"channels": 3})
    simulation = loaded.rig.simulation.model_copy(update={"channel_responses": [1.6, 1.0, 0.5]})
    in_colour = loaded.rig.model_copy(update={"camera": camera, "simulation": simulation})
    frames = []
    for rig in (loaded.rig, in_colour):
        own = SimulatedCamera(simulated_scene(replace(loaded, rig=rig)), SimulatedClock())
        own.set_exposure_s(0.005)
        frames.append(own.grab(1)[0])
    mono, frame = frames
    assert mono.colour is None
    assert frame.colour is not None
    assert np.array_equal(frame.colour[..., 1], mono.image)
    light = frame.colour.astype(float) - camera.black_level_dn
    bright = light[..., 1] > 500
    assert light[bright][:, 0] / light[bright][:, 1] == pytest.approx(1.6, abs=0.2)
    assert light[bright][:, 2] / light[bright][:, 1] == pytest.approx(0.5, abs=0.1)
    own = SimulatedCamera(simulated_scene(replace(loaded, rig=in_colour)), SimulatedClock())
    own.set_exposure_s(0.005 * 0.75 * camera.max_dn / float(light[..., 1].max()))
    frame = own.grab(1)[0]
    assert frame.colour is not None
    trusted = frame.colour < TRUSTED_SHARE * camera.max_dn
    lost = trusted[..., 1] & ~trusted[..., 0]
    assert lost.any()
    assert np.all(frame.image[lost] == camera.max_dn)
    assert np.array_equal(frame.image[trusted.all(-1)], frame.colour[trusted.all(-1)][:, 1])
