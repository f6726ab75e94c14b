"""Noise, dark level, saturation and lamp drift of the simulated images."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.load import Loaded
from sim.clock import SimulatedClock
from sim.scene.camera import SimulatedCamera
from tests.support.scans import changed, simulated_scene

CENTRE = slice(200, 300), slice(250, 400)


def test_the_noise_depends_on_seed_and_step_only(demo: Loaded) -> None:
    def image(loaded: Loaded, step: int) -> bytes:
        scene = simulated_scene(loaded)
        scene.begin_step(step, 0.0)
        return SimulatedCamera(scene, SimulatedClock()).grab(2)[1].image.tobytes()

    simulation = demo.rig.simulation.model_copy(update={"seed": 13})
    assert image(demo, 3) == image(demo, 3)
    assert image(demo, 3) != image(demo, 4)
    assert image(demo, 3) != image(changed(demo, rig={"simulation": simulation}), 3)


def test_noise_is_photon_noise_read_noise_and_rounding(demo: Loaded) -> None:
    settings = demo.rig.camera
    camera = SimulatedCamera(simulated_scene(demo), SimulatedClock())
    camera.set_exposure_s(0.03)
    frames = np.stack([frame.image.astype(float) for frame in camera.grab(24)])
    mean, variance = frames.mean(axis=0), frames.var(axis=0, ddof=1)
    electrons = (mean - settings.black_level_dn) * settings.electrons_per_dn
    expected = (
        electrons + settings.read_noise_electrons**2
    ) / settings.electrons_per_dn**2 + 1 / 12
    # 15 000 pixels with 23 degrees of freedom each: u of the mean variance is 0.3 %.
    assert variance[CENTRE].mean() / expected[CENTRE].mean() == pytest.approx(1.0, abs=0.02)
    # Neighbouring pixels are uncorrelated; two frames correlate by -1/23, because the mean of 24
    # has been subtracted.
    noise = (frames - mean)[:, *CENTRE]
    assert abs(np.corrcoef(noise[0, :, 1:].ravel(), noise[0, :, :-1].ravel())[0, 1]) < 0.03
    between = np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]
    assert between == pytest.approx(-1 / 23, abs=0.03)


def test_a_dark_frame_holds_the_black_level_and_the_dark_current(demo: Loaded) -> None:
    scene = simulated_scene(demo)
    scene.lit = False
    camera = SimulatedCamera(scene, SimulatedClock())
    camera.set_exposure_s(2.0)
    settings = demo.rig.camera
    expected = settings.black_level_dn
    expected += 2.0 * settings.dark_current_electrons_per_s / settings.electrons_per_dn
    assert camera.grab(1)[0].image.mean() == pytest.approx(expected, abs=0.02)


def test_an_overexposed_image_saturates_at_full_scale(demo: Loaded) -> None:
    camera = SimulatedCamera(simulated_scene(demo), SimulatedClock())
    camera.set_exposure_s(2.0)
    image = camera.grab(1)[0].image
    # At the full well half of the pixels' noise lies above full scale.
    assert np.median(image[CENTRE]) == demo.rig.camera.max_dn == image.max()


def test_the_lamp_drifts_with_the_clock_but_not_during_an_interruption(demo: Loaded) -> None:
    scene, clock = simulated_scene(demo), SimulatedClock()
    scene.use_clock(clock)
    camera = SimulatedCamera(scene, clock)
    camera.set_exposure_s(0.03)
    levels = []
    for step, scan_s in ((0, 0.0), (1, 0.0), (1, 10 * 3600.0)):
        clock.sleep(3600.0)
        scene.begin_step(step, scan_s)
        levels.append(camera.grab(1)[0].image[CENTRE].mean() - 64)
    clock.sleep(10 * 3600.0)
    levels.append(camera.grab(1)[0].image[CENTRE].mean() - 64)
    drift = demo.rig.simulation.lamp_drift_per_hour
    expected = [1.0, 1.0, 1 + 10 * drift, 1 + 20 * drift]
    assert np.array(levels) / levels[0] == pytest.approx(expected, rel=1e-3)
