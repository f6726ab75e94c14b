"""Defects of a camera: true exposures, hot and unequal pixels, response curve, limited range."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.config.camera import CameraDefects
from sim.clock import SimulatedClock
from sim.defects.camera import (
    bent,
    dark_current_factor,
    hot_electrons_per_s,
    limit_range,
    read_back_s,
    true_exposure_s,
    unequal_responses,
)
from sim.scene.camera import SimulatedCamera
from tests.support.scans import changed, simulated_scene, small_scan


@pytest.mark.parametrize(
    ("defects", "true_s"),
    [
        ({}, 0.05),
        ({"fixed_exposure_s": 0.0157}, 0.0157),
        ({"longest_exposure_s": 0.033}, 0.033),
        ({"exposures_s": [0.0312, 0.0625]}, 0.0625),
        ({"exposures_s": [0.0312, 0.0625], "longest_exposure_s": 0.04}, 0.04),
    ],
)
def test_the_true_exposure_and_the_one_reported(defects: dict[str, Any], true_s: float) -> None:
    for reads_back, reported_s in (("set", 0.05), ("taken", true_s)):
        camera = CameraDefects.model_validate({**defects, "reads_back": reads_back})
        assert true_exposure_s(0.05, camera) == true_s
        assert read_back_s(0.05, camera) == reported_s


@given(st.floats(1e-4, 10.0))
def test_a_camera_without_defects_exposes_as_it_is_told(exposure_s: float) -> None:
    assert true_exposure_s(exposure_s, CameraDefects()) == exposure_s


def test_limited_range_has_black_at_16_and_white_at_235() -> None:
    grey = np.arange(256, dtype=np.uint8).reshape(16, 16)
    limited = limit_range(grey, CameraDefects(limited_range="undeclared"))
    assert (int(limited.min()), int(limited.max())) == (16, 235)
    assert limit_range(grey, CameraDefects()) is grey
    wide = grey.astype(np.uint16)
    assert limit_range(wide, CameraDefects(limited_range="declared")) is wide


def test_a_hot_pixel_of_the_simulated_camera() -> None:
    small = small_scan()
    hot = {"row": 7, "column": 9, "electrons_per_s": 20_000.0}
    simulation = small.rig.simulation.model_copy(
        update={"camera_defects": CameraDefects.model_validate({"hot_pixels": [hot]})}
    )
    scene = simulated_scene(changed(small, rig={"simulation": simulation}))
    scene.lit = False
    camera = SimulatedCamera(scene, SimulatedClock())
    camera.set_exposure_s(0.5)
    image = camera.grab(1)[0].image.astype(float)
    extra = image[7, 9] - np.median(image)
    assert extra == pytest.approx(10_000 / small.rig.camera.electrons_per_dn, rel=0.05)
    assert np.sum(image > np.median(image) + 100) == 1
    assert hot_electrons_per_s((8, 8), CameraDefects(), np.random.default_rng()) is None


def pictures(defects: dict[str, Any], count: int = 24, *, lit: bool = True) -> Any:
    """Mean picture of a small camera with defects, above black, in electrons at full scale."""
    small = small_scan()
    own = CameraDefects.model_validate(defects)
    simulation = small.rig.simulation.model_copy(update={"camera_defects": own})
    scene = simulated_scene(changed(small, rig={"simulation": simulation}))
    scene.lit = lit
    camera = SimulatedCamera(scene, SimulatedClock())
    camera.set_exposure_s(0.03)
    settings = small.rig.camera
    mean = np.mean([frame.image for frame in camera.grab(count)], axis=0)
    return (mean - settings.black_level_dn) * settings.electrons_per_dn


@pytest.mark.parametrize(
    ("defects", "curve"),
    [
        ({"gamma": 2.2}, lambda share: share ** (1 / 2.2)),
        ({"nonlinearity": 0.01}, lambda share: share * (1 + 0.01 * (1 - share))),
    ],
)
def test_the_response_curve_of_the_simulated_camera(defects: dict[str, Any], curve: Any) -> None:
    well = small_scan().rig.camera.full_well_electrons
    light, seen = pictures({}) / well, pictures(defects) / well
    bright = light > 0.2
    assert bright.sum() > 500
    assert seen[bright] == pytest.approx(curve(light[bright]), rel=0.01)
    assert np.mean(seen[bright] / curve(light[bright])) == pytest.approx(1.0, abs=2e-4)


def test_a_curve_leaves_black_and_full_scale_in_their_place() -> None:
    camera = small_scan().rig.camera
    ends = np.array([[camera.black_level_dn, camera.max_dn]], dtype=np.float32)
    for defects in ({"gamma": 2.2}, {"nonlinearity": -0.3}, {"gamma": 0.5, "nonlinearity": 0.1}):
        own = CameraDefects.model_validate(defects)
        assert bent(ends, camera, own) == pytest.approx(ends, rel=1e-6)


def test_unequal_pixels_of_the_simulated_camera() -> None:
    """The same pixels in each frame; responses scale the light and not the dark."""
    even = pictures({})
    bright = even > 0.2 * even.max()
    ratio = (pictures({"prnu": 0.05}) / even)[bright]
    assert np.std(ratio) == pytest.approx(0.05, rel=0.1)
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.01)
    dark = pictures({"dsnu_electrons": 30.0}, lit=False)
    assert np.std(dark) == pytest.approx(30.0, rel=0.1)
    assert np.std(pictures({"prnu": 0.05}, lit=False)) < 4.0


def test_dead_pixels_see_no_light_and_drawn_ones_have_their_share() -> None:
    dead = [{"row": 50, "column": 60}, {"row": 51, "column": 70}]
    seen = pictures({"dead_pixels": dead})
    assert seen[50, 60] == pytest.approx(0.0, abs=10.0)
    assert seen[51, 70] == pytest.approx(0.0, abs=10.0)
    assert seen[50, 61] > 1000
    random = np.random.default_rng(1)
    responses = unequal_responses((400, 400), CameraDefects(dead_share=0.01), random)
    assert responses is not None
    assert np.mean(responses == 0) == pytest.approx(0.01, rel=0.1)
    assert set(np.unique(responses)) == {0.0, 1.0}
    assert unequal_responses((8, 8), CameraDefects(), random) is None


def test_drawn_hot_pixels_have_their_share_and_mean() -> None:
    defects = CameraDefects(hot_share=0.02, hot_electrons_per_s=500.0)
    current = hot_electrons_per_s((400, 400), defects, np.random.default_rng(2))
    assert current is not None
    assert np.mean(current > 0) == pytest.approx(0.02, rel=0.1)
    assert current[current > 0].mean() == pytest.approx(500.0, rel=0.1)


def test_dark_current_doubles_with_the_temperature() -> None:
    warm = CameraDefects(warming_k=14.0, warming_s=100.0, doubling_k=7.0)
    assert dark_current_factor(0.0, warm) == 1.0
    assert dark_current_factor(1e6, warm) == pytest.approx(4.0)
    assert dark_current_factor(100 * np.log(2), warm) == pytest.approx(2.0)
    assert dark_current_factor(100.0, CameraDefects()) == 1.0


def test_a_warm_camera_is_darker_at_the_start_than_later() -> None:
    """Noise apart: the dark current of all pixels, and that of hot ones."""
    small = small_scan()
    hot = {"row": 7, "column": 9, "electrons_per_s": 2e4}
    warming = {"warming_k": 7.0, "warming_s": 600.0, "doubling_k": 7.0, "hot_pixels": [hot]}
    own = CameraDefects.model_validate(warming)
    simulation = small.rig.simulation.model_copy(update={"camera_defects": own})
    camera = small.rig.camera.model_copy(update={"dark_current_electrons_per_s": 2000.0})
    scene = simulated_scene(changed(small, rig={"simulation": simulation, "camera": camera}))
    scene.lit = False
    clock = SimulatedClock()
    scene.use_clock(clock)
    sensor = SimulatedCamera(scene, clock)
    sensor.set_exposure_s(0.5)
    early, late = [], []
    for pictures_, age_s in ((early, 0.0), (late, 1e5)):
        scene.begin_step(0, age_s)
        pictures_ += [f.image.astype(float) - camera.black_level_dn for f in sensor.grab(16)]
    ratio = np.mean(late, axis=0) / np.mean(early, axis=0)
    assert np.median(ratio) == pytest.approx(2.0, rel=0.01)
    assert ratio[7, 9] == pytest.approx(2.0, rel=0.01)
