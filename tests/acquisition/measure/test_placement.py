"""Effect of a misplaced sample: the budget's derivative is that of rendered images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.measure.placement import Placement, placement_u_dn, tilt_deg
from acquisition.measure.window import window_at
from analysis.models import MODELS
from instrument.config.load import Loaded, load_protocol
from instrument.config.simulated.sample import SimulatedSample
from instrument.devices import Frame
from instrument.geometry import FloatArray, Geometry
from instrument.pinhole import Pinhole
from sim.scene.render import electrons_per_s
from sim.scene.scene import Scene
from tests.support.paths import CONFIGS
from tests.support.scans import changed, exact_rig

SAMPLES = {
    "lambert": {"albedo": 0.8},
    "oren_nayar": {"albedo": 0.03, "sigma_deg": 30.0},
    "oren_nayar+torrance_sparrow": {"albedo": 0.3, "sigma_deg": 20.0, "ks": 0.076},
    "lambert+ggx": {"albedo": 0.03, "f0": 0.04, "alpha": 0.3},
}
U_MM = 0.2


def _loaded(rig: str, model: str, mottling: float, seed: int) -> Loaded:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")
    sample = SimulatedSample(model=model, parameters=SAMPLES[model], mottling=mottling)
    exact = replace(changed(demo, simulated_sample=sample), rig=exact_rig(demo.rig))
    simulation = exact.rig.simulation.model_copy(update={"seed": seed})
    return changed(exact, rig={"simulation": simulation})


def _image(loaded: Loaded, angles: tuple[float, float, float], height_mm: float) -> FloatArray:
    simulation = loaded.rig.simulation.model_copy(update={"sample_height_mm": height_mm})
    scene = Scene.of(loaded.rig.model_copy(update={"simulation": simulation}), loaded.protocol)
    for axis, angle in zip(("theta_i", "theta_r", "dphi"), angles, strict=True):
        scene.set_axis(axis, angle)
    return electrons_per_s(scene).astype(np.float64)


def _stated(loaded: Loaded, angles: tuple[float, float, float], image: FloatArray) -> float:
    """First-order effect as the budget and the fit have it, relative to the signal."""
    theta_i, theta_r, dphi = angles
    rig, patch = loaded.rig, loaded.protocol.window
    window = window_at(theta_r, Pinhole.of(rig), patch.width_mm, patch.height_mm)
    placement = Placement(U_MM, theta_i, rig.lamp_distance_mm)
    no_dark = np.zeros_like(image)
    frame = Frame(image, 1.0, 0.0)  # type: ignore[arg-type]  # not rounded to counts
    shown = placement_u_dn(frame.image, no_dark, window, placement)[0] / window.mean(
        image[window.crop]
    )
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    di, dr = (
        tilt_deg(np.array(angle), U_MM, distance)
        for angle, distance in ((theta_i, rig.lamp_distance_mm), (theta_r, rig.beam_length_mm))
    )
    step = np.array([-1.0, 0.0, 1.0])
    turned = Geometry.from_degrees(
        theta_i=theta_i + step * di, theta_r=theta_r + step * dr, dphi=dphi
    )
    low, here, high = MODELS[sample.model].brdf(turned, **sample.parameters)
    return float(shown + (high - low) / (2 * here))


def _true(loaded: Loaded, angles: tuple[float, float, float]) -> float:
    patch = loaded.protocol.window
    window = window_at(angles[1], Pinhole.of(loaded.rig), patch.width_mm, patch.height_mm)
    low, here, high = (
        window.mean(_image(loaded, angles, height)[window.crop]) for height in (-U_MM, 0.0, U_MM)
    )
    return (high - low) / (2 * here)


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["bench_12bit", "paper_1995"])
@pytest.mark.parametrize("model", SAMPLES)
def test_the_stated_effect_is_that_of_rendered_images(rig: str, model: str, slow: bool) -> None:
    """At random angles, also out of plane and mottled; without --slow three of them."""
    random = np.random.default_rng([len(model), len(rig)])
    for seed in range(60 if slow else 3):
        mottling = float(random.choice([0.0, 0.02]))
        loaded = _loaded(rig, model, mottling, seed)
        view = random.uniform(-80, 80)
        angles = (random.uniform(5, 70), view, float(random.choice([0.0, random.uniform(0, 180)])))
        found, true = _stated(loaded, angles, _image(loaded, angles, 0.0)), _true(loaded, angles)
        # The image's texture is shifted by whole pixels: known to a few percent of its effect.
        texture = mottling * 2e-3 * (1 + abs(np.tan(np.radians(view))))
        assert found == pytest.approx(true, rel=0.03, abs=1e-5 + texture), angles


@pytest.mark.parametrize("theta_i", [0.0, 30.0, 54.7, 80.0])
def test_the_irradiance_grows_with_the_inverse_square_and_falls_with_the_cosine(
    theta_i: float,
) -> None:
    cosine, distance = np.cos(np.radians(theta_i)), 1000.0
    expected = (3 * cosine - 1 / cosine) / distance
    assert Placement(0.1, theta_i, distance).u_irradiance == pytest.approx(
        0.1 * expected, rel=1e-3, abs=1e-8
    )


@pytest.mark.parametrize("theta_i", [89.999, 90.0])
def test_at_grazing_incidence_all_light_may_be_lost(theta_i: float) -> None:
    assert Placement(0.2, theta_i, 1000.0).u_irradiance == -1.0
