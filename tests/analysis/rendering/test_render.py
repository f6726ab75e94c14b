"""Pictures obey the physics of light: energy, reciprocity, symmetry, shadows, limits."""

import math
from functools import partial

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.rendering.light import Light, light
from analysis.rendering.material import Material
from analysis.rendering.render import radiance, render
from analysis.rendering.shapes import SHAPES, sphere
from analysis.rendering.surface import unit
from instrument.geometry import FloatArray

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
