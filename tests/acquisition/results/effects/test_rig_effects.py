"""Effects that a rig file states: each has the shape and the sign of the simulated bench's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from acquisition.measure.window import window_at
from acquisition.results.effects.effect import Effect, Readings
from acquisition.results.effects.lens import lens_effects
from acquisition.results.effects.polarisation import polarisation_effects
from acquisition.results.effects.rig_effects import has_effects, rig_effects
from acquisition.results.effects.sensor import NONLINEAR, sensor_effects
from acquisition.results.effects.surface import TILT, surface_effects
from analysis.models import MODELS
from instrument.config.camera import CameraDefects
from instrument.config.load import Loaded
from instrument.config.rig import Simulation
from instrument.config.simulated.sample import SimulatedSample
from instrument.config.uncertainty.rig_lines import RigLines
from instrument.devices import Surface
from instrument.geometry import FloatArray, Geometry
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading
from sim.defects.camera import bent
from sim.scene.render import electrons_per_s
from tests.support.scans import changed, exact_rig, simulated_scene, small_scan

MATT = SimulatedSample(model="oren_nayar", parameters={"albedo": 0.6, "sigma_deg": 25.0})
DARK = SimulatedSample(model="lambert", parameters={"albedo": 0.03})
GLOSSY = SimulatedSample(
    model="lambert+torrance_sparrow", parameters={"albedo": 0.4, "ks": 0.1, "sigma_deg": 20.0}
)
BASE = small_scan("bench_12bit", 8)
IN_PLANE = [(i, 0.0, r) for i in (20.0, 60.0) for r in (-78.0, -40.0, 10.0, 70.0)]
OUT_OF_PLANE = [(40.0, 90.0, -60.0), (40.0, 90.0, 60.0), (60.0, 45.0, -70.0), (60.0, 120.0, 35.0)]
_TILE_DEG = 10.0


def bench(sample: SimulatedSample, **simulation: Any) -> Loaded:
    """The small rig without errors but these of its section `simulation`."""
    rig = exact_rig(BASE.rig)
    own = Simulation.model_validate({**rig.simulation.model_dump(), **simulation})
    small = {"source_solid_angle_sr": 1e-7, "receiver_solid_angle_sr": 1e-7, "u_placement_mm": 0.0}
    return changed(
        BASE, rig={"axes": rig.axes, "simulation": own, **small}, simulated_sample=sample
    )


def values(loaded: Loaded, places: list[tuple[float, float, float]]) -> FloatArray:
    """Window's mean of the sample over the tile's, without noise, at each place."""
    lamps = {place[:2] for place in places}
    tiles = {lamp: _mean(loaded, "white tile", *lamp, _TILE_DEG) for lamp in lamps}
    return np.array([_mean(loaded, "sample", *p) / tiles[p[:2]] for p in places])


@cache
def sound_values(model: str, count: int) -> FloatArray:
    """Values of the bench without errors, for the sample with this model."""
    sample = next(s for s in (MATT, DARK, GLOSSY) if s.model == model)
    return values(bench(sample), [*IN_PLANE, *OUT_OF_PLANE][:count])


def _mean(loaded: Loaded, surface: Surface, theta_i: float, dphi: float, theta_r: float) -> float:
    scene = simulated_scene(loaded)
    scene.surface = surface
    for axis, angle in (("theta_i", theta_i), ("dphi", dphi), ("theta_r", theta_r)):
        scene.set_axis(axis, angle)
    patch = loaded.protocol.window
    window = window_at(theta_r, Pinhole.of(loaded.rig), patch.width_mm, patch.height_mm)
    return window.mean(electrons_per_s(scene)[window.crop].astype(np.float64))


def reading(kind: Any, theta_i: float, dphi: float, theta_r: float, **more: Any) -> Reading:
    """A reading that holds little but its angles."""
    plain = dict.fromkeys(
        ("u_noise_dn", "u_quantisation_dn", "u_dark_dn", "u_placement_dn", "u_texture_dn"), 1.0
    )
    return Reading(
        step=0, kind=kind, surface="white tile" if kind == "tile" else "sample",
        theta_i_deg=theta_i, dphi_deg=dphi, theta_r_deg=theta_r, lamp_setting=int(theta_i),
        block=0, **{"signal_dn": 2000.0, "exposure_s": 0.01, "time_s": 0.0, **more}, frames=4,
        window_pixels=1000.0, saturated_pixels=0, peak_dn=2500.0, free_s=0.0, time_utc="",
        flags="", **plain,
    )  # fmt: skip


def readings(
    loaded: Loaded, places: list[tuple[float, float, float]], value: FloatArray, **lines: float
) -> Readings:
    rig = loaded.rig.model_copy(update={"uncertainty": RigLines(**lines)})
    return Readings(
        points=[reading("point", *place) for place in places],
        tiles=[reading("tile", *place[:2], _TILE_DEG) for place in places],
        value=value,
        absolute=True,
        rig=rig,
        protocol=loaded.protocol,
    )


def brdf(sample: SimulatedSample, places: list[tuple[float, float, float]]) -> FloatArray:
    theta_i, dphi, theta_r = np.array(places).T
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    return np.asarray(MODELS[sample.model].brdf(geometry, **sample.parameters))


CASES: dict[str, tuple[Any, SimulatedSample, dict[str, Any], dict[str, float], float]] = {
    # effects, sample, defect, line of the rig, agreement relative to the largest change
    "glare": (lens_effects, MATT, {"lens_defects": {"glare": 0.01}}, {"u_stray_light": 0.01}, 0.1),
    "glare on a dark sample": (
        lens_effects,
        DARK,
        {"lens_defects": {"glare": 0.01}, "background_reflectance": 0.04},
        {"u_stray_light": 0.01},
        0.1,
    ),
    "vignetting": (
        lens_effects, MATT, {"lens_defects": {"vignetting": 0.05}}, {"u_vignetting": 0.05}, 0.1
    ),
    "walls": (lens_effects, MATT, {"wall_light": 0.005}, {"u_wall_light": 0.005}, 0.1),
    "walls about a glossy sample": (
        lens_effects, GLOSSY, {"wall_light": 0.005}, {"u_wall_light": 0.005}, 0.1
    ),
    "polarised lamp": (
        polarisation_effects,
        MATT,
        {"lamp_defects": {"polarisation": 0.05}},
        {"u_polarisation_lamp": 0.05},
        0.3,
    ),
    "polarised lamp at the gloss": (
        polarisation_effects,
        GLOSSY,
        {"lamp_defects": {"polarisation": 0.05}},
        {"u_polarisation_lamp": 0.05},
        0.15,
    ),
    "polarised camera": (
        polarisation_effects,
        GLOSSY,
        {"lens_defects": {"polarisation": 0.02}},
        {"u_polarisation_camera": 0.02},
        0.15,
    ),
    "tilt": (
        surface_effects, MATT, {"sample_placement": {"tilt_deg": 0.2}}, {"u_tilt_deg": 0.2}, 0.05
    ),
    "tilt across": (
        surface_effects,
        GLOSSY,
        {"sample_placement": {"tilt_across_deg": 0.2}},
        {"u_tilt_across_deg": 0.2},
        0.05,
    ),
    "tile tilt": (
        surface_effects,
        MATT,
        {"tile_placement": {"tilt_deg": 0.2}},
        {"u_tile_tilt_deg": 0.2},
        0.05,
    ),
    "zero of theta_i": (
        surface_effects,
        GLOSSY,
        {"axis_defects": {"theta_i": {"zero_deg": 0.1}}},
        {"u_zero_theta_i_deg": 0.1},
        0.1,
    ),
    "zero of dphi": (
        surface_effects,
        GLOSSY,
        {"axis_defects": {"dphi": {"zero_deg": 0.2}}},
        {"u_zero_dphi_deg": 0.2},
        0.1,
    ),
    "zero of theta_r": (
        surface_effects,
        GLOSSY,
        {"axis_defects": {"theta_r": {"zero_deg": 0.1}}},
        {"u_zero_theta_r_deg": 0.1},
        0.1,
    ),
}  # fmt: skip


def predicted(
    effect: Effect, loaded: Loaded, places: list[tuple[float, float, float]]
) -> FloatArray:
    """Relative change of the values by one u: the effect's own, and that of the angles."""
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    by = [
        np.broadcast_to(a, len(places))
        for a in (effect.theta_i_deg, effect.dphi_deg, effect.theta_r_deg)
    ]
    moved = [
        tuple(np.array(place) + effect.u * np.array(move))
        for place, move in zip(places, np.array(by).T, strict=True)
    ]
    return effect.u * effect.by_one + brdf(sample, moved) / brdf(sample, places) - 1


@pytest.mark.parametrize("name", CASES)
def test_an_effect_has_shape_and_sign_of_the_simulated_defect(name: str) -> None:
    effects, sample, defect, line, close = CASES[name]
    sound, faulty = bench(sample), bench(sample, **defect)
    places = IN_PLANE + (OUT_OF_PLANE if effects is not lens_effects else [])
    found = values(faulty, places) / sound_values(sample.model, len(places)) - 1
    (effect,) = effects(readings(sound, places, brdf(sample, places), **line))
    expected = predicted(effect, sound, places)
    assert np.allclose(found, expected, atol=close * np.max(np.abs(found)), rtol=0)


def test_counts_out_of_proportion_count_beside_those_of_the_tile() -> None:
    """Excess of 1 % at no light and none at full scale, as the simulated camera has it."""
    camera = BASE.rig.camera
    full = camera.max_dn - camera.black_level_dn
    found = readings(BASE, IN_PLANE[:3], np.ones(3), u_linearity=0.01)
    points = [
        replace(p, signal_dn=share * full)
        for p, share in zip(found.points, (0.1, 0.5, 0.7), strict=True)
    ]
    tiles = [replace(t, signal_dn=0.5 * full) for t in found.tiles if t is not None]
    (effect,) = sensor_effects(replace(found, points=points, tiles=tiles))
    defects = CameraDefects(nonlinearity=0.01)
    flat = np.array([0.1, 0.5, 0.7], dtype=np.float32) * np.float32(full) + np.float32(
        camera.black_level_dn
    )
    excess = (bent(flat, camera, defects) - camera.black_level_dn) / (flat - camera.black_level_dn)
    assert effect.u * effect.by_one == pytest.approx(excess / excess[1] - 1, rel=0.01, abs=1e-6)


def test_a_dark_that_drifts_counts_more_the_later_and_the_darker() -> None:
    found = readings(BASE, IN_PLANE[:3], np.ones(3), u_dark_drift_electrons_per_s_per_h=36.0)
    points = [
        replace(found.points[0], time_s=100.0),  # takes the dark of its exposure
        replace(found.points[1], time_s=200.0),
        replace(found.points[2], time_s=200.0, signal_dn=500.0),
    ]
    tiles = [replace(t, time_s=100.0) for t in found.tiles if t is not None]
    (effect,) = sensor_effects(replace(found, points=points, tiles=tiles))
    electrons = 36.0 * (100.0 / 3600.0) * 0.01  # in the exposure
    dn = electrons / BASE.rig.camera.electrons_per_dn
    assert effect.u * effect.by_one == pytest.approx([0.0, dn / 2000.0, dn / 500.0])


def test_unequal_pixels_average_out_and_cancel_in_equal_windows() -> None:
    found = readings(BASE, IN_PLANE[:2], np.ones(2), u_pixel_response=0.01)
    points = [replace(found.points[0], window_pixels=100.0), found.points[1]]
    (effect,) = sensor_effects(replace(found, points=points))
    assert effect.independent
    assert effect.u * effect.by_one == pytest.approx([0.01 * np.sqrt(1 / 100 - 1 / 1000), 0.0])


def test_values_are_corrected_by_sizes_and_not_by_uncertainties() -> None:
    places = IN_PLANE[:3]
    value = brdf(MATT, places)
    plain = rig_effects(readings(BASE, places, value, u_tile_aged=0.002, u_linearity=0.01))
    assert np.all(plain.factor == 1)
    aged = rig_effects(readings(BASE, places, value, tile_aged=0.01, u_tile_aged=0.002))
    assert aged.factor == pytest.approx(1 / 1.01)
    (error,) = aged.shared
    assert error.u_relative == pytest.approx(0.002)
    assert has_effects(RigLines(tile_aged=0.01))
    assert not has_effects(RigLines())


def test_without_a_tile_errors_of_the_tile_do_not_count() -> None:
    lines = {"tile_aged": 0.01, "u_tile_tilt_deg": 0.1, "u_tilt_deg": 0.1, "u_linearity": 0.01}
    found = readings(BASE, IN_PLANE[:3], np.ones(3), **lines)
    bare = replace(found, tiles=[None] * 3, absolute=False)
    applied = rig_effects(bare)
    assert np.all(applied.factor == 1)
    assert [error.name for error in applied.shared] == [NONLINEAR, TILT]
    assert all(np.all(np.isfinite(error.u_relative)) for error in applied.shared)


@pytest.mark.parametrize("seed", range(3))
def test_polarisation_of_values_in_any_unit_is_that_of_absolute_ones(seed: int) -> None:
    """Without a tile the unit differs from one setting of the lamp to the next."""
    random = np.random.default_rng(seed)
    sample = (MATT, GLOSSY)[seed % 2]
    places = [(i, 0.0, r) for i in random.uniform(10.0, 70.0, 2) for r in np.linspace(-80, 80, 11)]
    lines = {"u_polarisation_lamp": 0.05, "u_polarisation_camera": 0.02}
    known = readings(BASE, places, brdf(sample, places), **lines)
    levels = np.repeat(10 ** random.uniform(-6, 6) * random.uniform(0.7, 1.4, 2), 11)
    bare = replace(known, tiles=[None] * 22, absolute=False, value=known.value * levels)
    for ours, other in zip(polarisation_effects(bare), polarisation_effects(known), strict=True):
        most = 0.03 * np.max(np.abs(other.by_one))
        assert np.allclose(ours.by_one, other.by_one, atol=most, rtol=0), ours.name
