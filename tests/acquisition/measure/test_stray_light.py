"""Dark patch in the picture: what it shows of the light that the lens scatters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.measure.placement import Placement
from acquisition.measure.radiometry import Signal, average_dark, measure
from acquisition.measure.stray_light import BRIGHT, LEAVES, View, white_dn, with_dark_patch
from acquisition.measure.window import window_at
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from tests.support.scans import simulated_scene, small_scan
from tests.support.whole_scans.dark_patches import TRAP, with_patch

SMALL = small_scan(shrink=2)
THETA_I = 45.0


def seen(loaded: Loaded, theta_r: float = 0.0) -> Signal:
    """Signal of the sample at 45 deg, with what the dark patch adds to it."""
    scene = simulated_scene(loaded, THETA_I, theta_r)
    camera = SimulatedCamera(scene, SimulatedClock())
    camera.set_exposure_s(0.02)
    frames = camera.grab(2)
    scene.lit = False
    dark = average_dark(camera.grab(8), loaded.rig.camera)
    window = window_at(theta_r, Pinhole.of(loaded.rig), 20.0, 20.0)
    plain = measure(frames, dark, window, loaded.rig.camera, Placement(0.0, 0.0, 1.0), 10)
    return with_dark_patch(plain, frames, dark, view(loaded, theta_r))


def view(loaded: Loaded, theta_r: float) -> View:
    return View(loaded.rig, loaded.protocol.window, THETA_I, theta_r)


def test_without_glare_the_patch_shows_its_own_reflectance() -> None:
    loaded = with_patch(SMALL, TRAP)
    found = seen(loaded)
    own = TRAP.reflectance * white_dn(loaded.rig, THETA_I, 0.02)
    assert found.patch_dn == pytest.approx(own, abs=5 * found.u_patch_dn + 0.01 * own)
    assert 0 < found.u_patch_dn < 0.02 * own
    assert not found.flags


def test_the_scattered_light_is_that_of_gaussians_over_the_picture() -> None:
    """Compared with Gaussians over all pixels of an uneven picture."""
    loaded = with_patch(SMALL, TRAP)
    camera = loaded.rig.camera
    rows, columns = np.mgrid[: camera.height_px, : camera.width_px].astype(float)
    light = 500.0 + columns + 800.0 * (np.hypot(rows - 100, columns - 60) < 50)
    image = np.rint(light).astype(np.uint16)
    dark = average_dark([Frame(np.zeros_like(image), 0.02, 0.0)] * 2, camera)
    plain = replace(seen(with_patch(SMALL, None)), flags="")
    found = with_dark_patch(plain, [Frame(image, 0.02, 0.0)], dark, view(loaded, 0.0))
    pinhole = Pinhole.of(loaded.rig)
    for width, name in ((0.15, "middle_window_dn"), (0.45, "far_window_dn")):
        sigma = width * camera.width_px
        own = window_at(0.0, pinhole, 20.0, 20.0)
        weights = np.zeros(light.shape)
        weights[own.crop] = own.weights
        for axis, size in enumerate(light.shape):
            apart = np.subtract.outer(np.arange(size), np.arange(size))
            share = np.exp(-((apart / sigma) ** 2) / 2) / (np.sqrt(2 * np.pi) * sigma)
            weights = np.moveaxis(np.tensordot(share, weights, (1, axis)), 0, axis)
        assert getattr(found, name) == pytest.approx(float(np.vdot(weights, light)), rel=5e-3)


@pytest.mark.parametrize(
    ("change", "flag"), [({"y_mm": 40.0}, LEAVES), ({"y_mm": 22.0}, BRIGHT), ({}, "")]
)
def test_a_patch_that_is_not_seen_or_not_dark_flags_the_point(
    change: dict[str, float], flag: str
) -> None:
    patch = TRAP.model_copy(update=change)
    assert seen(with_patch(SMALL, patch), 40.0).flags == flag


def test_without_a_patch_nothing_changes() -> None:
    found = seen(with_patch(SMALL, None))
    assert found == replace(found, patch_dn=0.0, u_patch_dn=0.0, far_patch_dn=0.0)
