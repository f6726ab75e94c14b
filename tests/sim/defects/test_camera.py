"""Defects of a camera: true exposures, hot pixels and limited range."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from instrument.config.camera import CameraDefects
from sim.clock import SimulatedClock
from sim.defects.camera import hot_electrons_per_s, limit_range, read_back_s, true_exposure_s
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
    assert hot_electrons_per_s((8, 8), CameraDefects()) is None
