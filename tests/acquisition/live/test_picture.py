"""Pictures for the page: no saturated pixel is lost, whatever the size; sharpness finds focus."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from acquisition.live.picture import jpeg_of, numbers_of, sharpness
from acquisition.measure.window import window_at
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole


def decoded(jpeg: bytes) -> FloatArray:
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR).astype(float)


@pytest.mark.parametrize("seed", range(6))
def test_one_saturated_pixel_anywhere_is_red_in_the_picture_of_any_camera(seed: int) -> None:
    random = np.random.default_rng(seed)
    rows, columns = random.integers(60, 1300, 2)
    depth = random.choice([255, 4095, 65535])
    image = random.integers(0, depth // 2, (rows, columns)).astype(np.uint16)
    row, column = random.integers(0, rows), random.integers(0, columns)
    image[row, column] = depth
    drawn = decoded(jpeg_of(image, float(depth)))
    assert drawn.shape[0] / drawn.shape[1] == pytest.approx(rows / columns, rel=0.05)
    assert drawn.shape[0] * drawn.shape[1] <= 2.3 * 640 * 480
    redness = drawn[..., 2] - drawn[..., 1]
    found = np.unravel_index(np.argmax(redness), redness.shape)
    scale = rows / drawn.shape[0]
    assert redness.max() > 60
    assert found[0] == pytest.approx(row / scale, abs=2)
    assert found[1] == pytest.approx(column / scale, abs=2)


def test_without_saturation_nothing_is_red() -> None:
    image = np.full((480, 512), 4094, np.uint16)
    drawn = decoded(jpeg_of(image, 4095.0))
    assert np.ptp(drawn, axis=2).max() < 8
    assert drawn.mean() > 250


def test_the_numbers_are_those_of_the_frame_and_of_its_window(demo: Loaded) -> None:
    camera, patch = demo.rig.camera, demo.protocol.window
    window = window_at(35.0, Pinhole.of(demo.rig), patch.width_mm, patch.height_mm)
    image = np.zeros((camera.height_px, camera.width_px), np.uint16)
    image[window.crop][window.counted] = 1000
    image[:2, :5] = camera.max_dn
    found = numbers_of(Frame(image, 0.01, 0.0), window, camera)
    assert (found.window_mean_dn, found.peak_dn) == (1000.0, camera.max_dn)
    assert (found.saturated_pixels, found.window_saturated_pixels) == (10, 0)
    assert (found.width_px, found.height_px) == (camera.width_px, camera.height_px)
    assert np.allclose(found.outline, window.outline_px, atol=0.05)


def test_sharpness_grows_as_the_lens_is_focused_whatever_the_exposure() -> None:
    random = np.random.default_rng(1)
    scene = cv2.GaussianBlur(
        random.uniform(500.0, 3000.0, (240, 256)).astype(np.float32), (0, 0), 1
    )
    found = []
    for blur_px in (8.0, 4.0, 2.0, 1.0):
        light = cv2.GaussianBlur(scene, (0, 0), blur_px)
        noisy = light + random.normal(0.0, 5.0, light.shape)
        found.append(sharpness(np.clip(noisy + 64, 0, 4095).astype(np.uint16), 64.0))
        half = np.clip(noisy / 2 + 64, 0, 4095).astype(np.uint16)
        assert sharpness(half, 64.0) == pytest.approx(found[-1], rel=0.1)
    assert found == sorted(found)
    assert found[-1] > 2 * found[0]
    assert sharpness(np.zeros((10, 10), np.uint16), 64.0) == 0.0
