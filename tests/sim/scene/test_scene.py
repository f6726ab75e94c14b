"""The simulated scene, stage, camera and operator."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.axes import SimulatedAxis
from instrument.config.load import Loaded, load_protocol
from instrument.devices import Request
from instrument.errors import DeviceError
from instrument.pinhole import Pinhole, area_per_pixel_mm2
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from sim.scene.operator import SimulatedOperator
from sim.scene.render import electrons_per_s
from sim.scene.scene import Scene
from sim.scene.stage import SimulatedStage
from tests.support.paths import CONFIGS
from tests.support.scans import changed, exact_rig


def scene_of(loaded: Loaded, theta_i: float = 45.0, theta_r: float = 0.0) -> Scene:
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    scene = Scene(loaded.rig, loaded.protocol, sample)
    for axis, angle in (("theta_i", theta_i), ("dphi", 0.0), ("theta_r", theta_r)):
        scene.set_axis(axis, angle)
    return scene


def stage_of(loaded: Loaded, **changes: float) -> tuple[SimulatedStage, SimulatedClock, Scene]:
    axis = loaded.rig.axes.theta_r
    assert isinstance(axis, SimulatedAxis)
    clock, scene = SimulatedClock(), scene_of(loaded)
    return SimulatedStage("theta_r", axis.model_copy(update=changes), scene, clock), clock, scene


def test_a_move_takes_the_time_of_its_kinematics(demo: Loaded) -> None:
    stage, clock, _ = stage_of(demo)
    stage.home()
    start_s = clock.now_s()
    stage.start_move(50.0)  # 20 deg/s at 40 deg/s^2: 3 s
    assert clock.now_s() == start_s
    assert stage.wait() == pytest.approx(50.0)
    assert clock.now_s() - start_s == pytest.approx(3.0)


def test_nothing_moves_before_homing_or_past_a_limit(demo: Loaded) -> None:
    stage, _, _ = stage_of(demo)
    with pytest.raises(DeviceError, match="theta_r: not homed"):
        stage.start_move(10.0)
    stage.home()
    with pytest.raises(DeviceError, match=r"88\.5 deg asked for; its limits are -88 to 88 deg"):
        stage.start_move(88.5)
    assert stage.wait() == 0.0


def test_a_stop_ends_the_move_where_the_axis_is_and_may_come_twice(demo: Loaded) -> None:
    stage, clock, _ = stage_of(demo)
    stage.home()
    stage.start_move(50.0)
    clock.sleep(1.5)
    stage.stop()
    stage.stop()
    assert stage.wait() == pytest.approx(25.0)


def test_zero_and_sign_stand_between_the_device_and_the_scene(demo: Loaded) -> None:
    stage, _, scene = stage_of(demo, zero_deg=100.0, sign=-1, u_deg=0.0)
    stage.home()
    stage.start_move(70.0)
    assert stage.wait() == pytest.approx(70.0)
    assert scene.true_deg["theta_r"] == pytest.approx(30.0, abs=0.1)


def test_a_return_to_an_angle_is_a_return_to_the_same_true_angle(demo: Loaded) -> None:
    scene = scene_of(demo)
    scene.set_axis("theta_r", 20.0)
    first = scene.true_deg["theta_r"]
    scene.set_axis("theta_r", 40.0)
    scene.set_axis("theta_r", 20.0)
    assert scene.true_deg["theta_r"] == first != 20.0
    assert abs(first - 20.0) < 6 * demo.rig.axes.theta_r.u_deg


def test_the_same_seed_gives_the_same_bytes_and_another_seed_does_not(demo: Loaded) -> None:
    def picture(loaded: Loaded, step: int) -> bytes:
        scene = scene_of(loaded)
        scene.begin_step(step, 0.0)
        return SimulatedCamera(scene, SimulatedClock()).grab(2)[1].image.tobytes()

    simulation = demo.rig.simulation.model_copy(update={"seed": 13})
    assert picture(demo, 3) == picture(demo, 3)
    assert picture(demo, 3) != picture(demo, 4)
    assert picture(demo, 3) != picture(changed(demo, rig={"simulation": simulation}), 3)


def test_noise_is_photons_read_noise_and_rounding(demo: Loaded) -> None:
    camera = demo.rig.camera
    eye = SimulatedCamera(scene_of(demo), SimulatedClock())
    eye.set_exposure_s(0.03)
    frames = np.stack([f.image.astype(float) for f in eye.grab(24)])
    mean, variance = frames.mean(axis=0), frames.var(axis=0, ddof=1)
    electrons = (mean - camera.black_level_dn) * camera.electrons_per_dn
    expected = (electrons + camera.read_noise_electrons**2) / camera.electrons_per_dn**2 + 1 / 12
    middle = slice(200, 300), slice(250, 400)
    # 15 000 pixels with 23 degrees of freedom each: the mean variance is known to 0.3 %.
    ratio = variance[middle].mean() / expected[middle].mean()
    assert ratio == pytest.approx(1.0, abs=0.02)
    # No pixel knows of its neighbour or of the frame before.
    noise = frames[:, 200:300, 250:400] - mean[200:300, 250:400]
    assert abs(np.corrcoef(noise[0, :, 1:].ravel(), noise[0, :, :-1].ravel())[0, 1]) < 0.03
    # (the mean of 24 frames is subtracted, so two frames correlate by -1/23)
    between = np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]
    assert between == pytest.approx(-1 / 23, abs=0.03)


def test_a_dark_frame_is_the_black_level_and_the_dark_current(demo: Loaded) -> None:
    scene = scene_of(demo)
    scene.lit = False
    eye = SimulatedCamera(scene, SimulatedClock())
    eye.set_exposure_s(2.0)
    camera = demo.rig.camera
    expected = camera.black_level_dn
    expected += 2.0 * camera.dark_current_electrons_per_s / camera.electrons_per_dn
    assert eye.grab(1)[0].image.mean() == pytest.approx(expected, abs=0.02)


def test_too_long_an_exposure_saturates_and_stays_at_full_scale(demo: Loaded) -> None:
    eye = SimulatedCamera(scene_of(demo), SimulatedClock())
    eye.set_exposure_s(2.0)
    image = eye.grab(1)[0].image
    # At the full well half of the pixels' noise lies above full scale.
    assert np.median(image[200:300, 250:400]) == demo.rig.camera.max_dn == image.max()


def test_an_exposure_that_the_camera_does_not_have_is_refused(demo: Loaded) -> None:
    eye = SimulatedCamera(scene_of(demo), SimulatedClock())
    with pytest.raises(DeviceError, match=r"exposure 9 s asked for; allowed: 0\.0005 to 2 s"):
        eye.set_exposure_s(9.0)


def test_the_lamp_drifts_with_the_plan_s_time(demo: Loaded) -> None:
    scene, clock = scene_of(demo), SimulatedClock()
    eye = SimulatedCamera(scene, clock)
    eye.set_exposure_s(0.03)
    before = eye.grab(1)[0].image[200:300, 250:400].mean() - 64
    clock.sleep(3600.0)  # an interruption ages no lamp: a resumed scan is as if it never stopped
    scene.begin_step(1, 10 * 3600.0)
    after = eye.grab(1)[0].image[200:300, 250:400].mean() - 64
    drift = demo.rig.simulation.lamp_drift_per_hour
    assert after / before == pytest.approx(1 + 10 * drift, rel=1e-3)


def test_a_rendered_lambertian_sample_keeps_its_flux_at_every_view_angle(demo: Loaded) -> None:
    """Electrons over the pixels' area on the sample add up to radiance times area."""
    sample = demo.protocol.simulated_sample
    assert sample is not None
    flat = sample.model_copy(
        update={"model": "lambert", "parameters": {"albedo": 0.8}, "mottling": 0.0}
    )
    background = exact_rig(demo.rig).simulation.model_copy(update={"background_reflectance": 0.0})
    rig = exact_rig(demo.rig).model_copy(update={"simulation": background, "lamp_distance_mm": 1e6})
    loaded = changed(demo, rig=dict(rig), simulated_sample=flat)
    camera = Pinhole.of(rig)
    rows, columns = np.ogrid[: camera.height_px, : camera.width_px]
    for theta_r in (0.0, 50.0, -75.0):
        picture = electrons_per_s(scene_of(loaded, 60.0, theta_r)) / camera.cos4(columns, rows)
        area = area_per_pixel_mm2(camera.homography(theta_r), columns, rows)
        flux = np.sum(picture * area) / (50.8 * 50.8)
        white = rig.lamp.white_electrons_per_s
        assert flux == pytest.approx(0.8 * white * np.cos(np.radians(60)), rel=1e-3)


def test_the_operator_does_what_is_asked(demo: Loaded) -> None:
    by_hand = load_protocol(
        CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml"
    )
    scene, clock = scene_of(by_hand), SimulatedClock()
    operator = SimulatedOperator(scene, clock)
    answer = operator.ask(Request("set axis", "", axis="theta_i", angle_deg=60.0))
    assert answer == "60"
    assert scene.true_deg["theta_i"] == pytest.approx(60.0, abs=2.0)
    operator.ask(Request("place", "", surface="white tile"))
    operator.ask(Request("cover lamp", ""))
    assert (scene.surface, scene.lit) == ("white tile", False)
    operator.ask(Request("uncover lamp", ""))
    assert scene.lit
    assert clock.now_s() == pytest.approx(60 + 60 + 15 + 15)
