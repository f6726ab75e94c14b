"""Pictures obey the physics of light: energy, reciprocity, symmetry, shadows, limits."""

import math
from functools import partial

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.rendering.angles import local_geometry, longitudes
from analysis.rendering.cross_section import across
from analysis.rendering.light import HEADLIGHT, Light, light
from analysis.rendering.lobes import lobes
from analysis.rendering.material import Material
from analysis.rendering.reflectance_map import reflectance_map
from analysis.rendering.render import radiance, render
from analysis.rendering.shapes import SHAPES, cylinder, sphere, vase
from analysis.rendering.surface import unit
from instrument.geometry import FloatArray, Geometry

RNG = np.random.default_rng(23)
LAMBERT = Material.named("lambert", albedo=0.7)
CLAY = Material.named("oren_nayar_exact", albedo=0.7, sigma_deg=40.0)
"""The clay vase of Oren and Nayar 1995, Figure 23."""
ROUGH = partial(MODELS["oren_nayar"].brdf, albedo=0.7, sigma_deg=40.0)


def facing(count: int) -> FloatArray:
    """Random unit vectors (count, 3) of which each has z above 0."""
    found = unit(RNG.normal(size=(count, 3)))
    found[:, 2] = np.abs(found[:, 2])
    return found


def test_angles_are_those_of_the_frame_about_the_normal() -> None:
    normal, lamp = facing(50), facing(1)[0]
    normal = normal[normal @ lamp > 0]
    found = local_geometry(normal, lamp)
    for k, n in enumerate(normal):
        across_it = unit(np.cross(n, RNG.normal(size=3)))
        frame = np.stack([across_it, np.cross(n, across_it), n])
        own = Geometry.from_directions(frame @ lamp, frame[:, 2])
        assert found.theta_i_deg[k] == pytest.approx(own.theta_i_deg, abs=1e-9)
        assert found.theta_r_deg[k] == pytest.approx(own.theta_r_deg, abs=1e-9)
        assert math.cos(math.radians(found.dphi_deg[k] - own.dphi_deg)) == pytest.approx(1)


def test_longitude_and_latitude_give_the_angles_of_lamp_and_viewer() -> None:
    normal, lamp = facing(50), facing(1)[0]
    longitude, latitude, phase = longitudes(normal, lamp)
    assert np.cos(latitude) * np.cos(longitude) == pytest.approx(normal[:, 2])
    assert np.cos(latitude) * np.cos(longitude - phase) == pytest.approx(normal @ lamp)


def test_light_from_a_lambertian_sphere_obeys_its_phase_law() -> None:
    """2/3 albedo (sin a + (pi - a) cos a)/pi, for irradiance 1 (Lambert 1760)."""
    surface = sphere(300)
    for phase in np.radians([0.0, *RNG.uniform(5, 90, 3)]):
        lamp = light(math.degrees(phase), RNG.uniform(0, 360), irradiance=3.0)
        total = np.nansum(render(surface, LAMBERT, [lamp])) * surface.pixel**2
        law = (math.sin(phase) + (math.pi - phase) * math.cos(phase)) / math.pi
        assert total / 3.0 == pytest.approx(2 / 3 * 0.7 * law, rel=2e-3)


def test_no_material_reflects_more_than_falls_on_a_sphere() -> None:
    """Seen from everywhere: the integral over all phases."""
    phases = np.radians(np.arange(2.5, 90, 5.0))
    surface = sphere(60)
    for name in ("lambert", "oren_nayar", "wolff"):
        model = MODELS[name]
        brdf = partial(model.brdf, **{p.name: p.high if p.scale else p.default
                                      for p in model.parameters})  # fmt: skip
        powers = [
            np.nansum(render(surface, brdf, [light(math.degrees(a))])) * surface.pixel**2
            for a in phases
        ]
        half = 2 * math.pi * np.sum(np.array(powers) * np.sin(phases)) * math.radians(5)
        assert 0.1 * math.pi < half < math.pi


def test_lamp_and_viewer_may_change_places() -> None:
    """Radiance over cos(theta_i) is that with the two exchanged, facet by facet (Helmholtz)."""
    lamp, normal = facing(1)[0], facing(200)
    normal = normal[normal @ lamp > 0]
    middle = unit(lamp + np.array([0.0, 0.0, 1.0]))
    turned = 2 * (normal @ middle)[:, None] * middle - normal  # half a turn exchanges the two
    for name in ("lambert", "oren_nayar", "torrance_sparrow", "minnaert"):
        brdf = partial(MODELS[name].brdf, **{p.name: p.default for p in MODELS[name].parameters})
        one, other = (radiance(n, brdf, [Light(lamp)]) / (n @ lamp) for n in (normal, turned))
        assert one == pytest.approx(other, rel=1e-9)


def test_a_sphere_is_symmetric_about_the_lamp_and_turns_with_it() -> None:
    surface, angle = sphere(80), float(RNG.uniform(10, 80))
    right = render(surface, ROUGH, [light(angle)])
    assert right == pytest.approx(right[::-1], nan_ok=True)
    assert np.rot90(right) == pytest.approx(render(surface, ROUGH, [light(angle, 90)]), nan_ok=True)
    left = render(surface, ROUGH, [light(-angle)])
    assert right[:, ::-1] == pytest.approx(left, nan_ok=True)
    both = render(surface, ROUGH, [light(angle), light(-angle)])
    assert both == pytest.approx(left + right, nan_ok=True)
    assert np.nanargmax(np.nansum(right, axis=0)) > 40


def test_a_rough_surface_of_no_roughness_is_lamberts() -> None:
    for shape in SHAPES.values():
        surface, lamps = shape(40), [light(35, 60), light(10)]
        smooth = render(surface, Material.named("oren_nayar", albedo=0.7, sigma_deg=0.0), lamps)
        assert smooth == pytest.approx(render(surface, LAMBERT, lamps), nan_ok=True)


def test_the_clay_vase_is_flat_where_lamberts_is_not() -> None:
    """1995, Figure 24(a): nearly constant over most of the cross-section, with sigma = 40 degrees.

    .85 of the middle at 60 degrees, where Lambert's law has cos 60 = .50.
    """
    middle, aside = across(CLAY, [HEADLIGHT], np.array([0.0, 60.0]))
    assert aside / middle == pytest.approx(0.85, abs=0.005)
    middle, aside = across(LAMBERT, [HEADLIGHT], np.array([0.0, 60.0]))
    assert aside / middle == pytest.approx(0.5)


def test_a_lamp_20_degrees_aside_moves_the_peak_of_lambert_only_that_far() -> None:
    """1995, Figure 24(b): the peak of Lambert's vase is far from that of the rough one."""
    angles = np.arange(-89.0, 90.0)
    peak = {m.name: angles[np.argmax(across(m, [light(20)], angles))] for m in (LAMBERT, CLAY)}
    assert peak["lambert"] == 20
    assert peak["oren_nayar_exact"] > 35


@pytest.mark.parametrize(("size", "tilt"), [(120, 0.0), (121, 0.0)])
def test_the_body_of_the_vase_is_the_cross_section_of_a_cylinder(size: int, tilt: float) -> None:
    lamps = [light(20), HEADLIGHT]
    for surface in (vase(size), cylinder(size, tilt)):
        row = render(surface, ROUGH, lamps)[size // 2]
        seen = np.isfinite(row)
        angles = np.degrees(np.arcsin(surface.x[seen]))
        assert row[seen] == pytest.approx(across(ROUGH, lamps, angles), rel=1e-9)


def test_reflectance_maps_become_plane_with_roughness() -> None:
    """1995, Figure 25: sigma = 60 degrees is like the moon's linear map, Lambert's is not."""
    lamp = [light(10, 45)]
    rough = Material.named("oren_nayar_exact", albedo=0.9, sigma_deg=60.0)
    flat = Material.named("lambert", albedo=0.9)
    assert reflectance_map(rough, lamp, size=41).plane_r2 == pytest.approx(0.82, abs=0.005)
    assert reflectance_map(flat, lamp, size=41).plane_r2 == pytest.approx(0.33, abs=0.005)


def test_a_plane_map_has_r2_of_1_and_an_even_one_none() -> None:
    def linear(geometry: Geometry) -> FloatArray:  # Horn's moon: sqrt(cos i / cos r), squared
        return 1 / np.cos(geometry.theta_r)

    def even(geometry: Geometry) -> FloatArray:
        return 1 / np.cos(geometry.theta_i)

    assert reflectance_map(linear, [light(10, 30)], size=21).plane_r2 == pytest.approx(1)
    assert math.isnan(reflectance_map(even, [HEADLIGHT], size=21).plane_r2)


def test_tables_of_costly_models_show_what_the_model_says() -> None:
    surface, lamp = sphere(62), [light(float(RNG.uniform(0, 80)), 30)]
    table, each = render(surface, CLAY, lamp), render(surface, CLAY.brdf, lamp)
    off = np.abs(table - each)[np.isfinite(each)]
    assert np.max(off) < 0.01 * np.nanmax(each)
    assert np.median(off) < 0.002 * np.nanmax(each)


def test_lobes_of_a_model_add_up_to_it() -> None:
    views = np.linspace(-85, 85, 35)
    for name in ("unified", "oren_nayar+torrance_sparrow", "lambert"):
        model = MODELS[name]
        values = {p.name: p.default for p in model.parameters}
        parts = lobes(model, values, 40.0, views)
        whole = model.brdf(Geometry.from_degrees(theta_i=40.0, theta_r=views), **values)
        assert sum(parts.values()) == pytest.approx(whole)
        assert len(parts) == {"unified": 3, "lambert": 1}.get(name, 2)


def test_lamps_behind_the_surface_are_refused() -> None:
    assert light(90).direction[2] == 0
    with pytest.raises(ValueError, match=r"lamp at 100 degrees .* allowed: 0 to 90"):
        light(100)
    with pytest.raises(ValueError, match="irradiance = -1"):
        light(10, irradiance=-1)
