"""Figure 25 of the 1995 paper: reflectance maps."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.figure import Check, PaperFigure
from analysis.gallery.paper_1995.gaussian_slopes import ALBEDO, EXACT
from analysis.gallery.pictures import contours, even_levels
from analysis.models import MODELS
from analysis.rendering.light import light
from analysis.rendering.reflectance_map import ReflectanceMap, reflectance_map
from instrument.geometry import Brdf

_LAMP = light(10.0, 45.0)


def _map(brdf: Brdf) -> ReflectanceMap:
    return reflectance_map(brdf, (_LAMP,), reach=1.5, size=121)


def _levels(found: ReflectanceMap) -> list[float]:
    """Eleven brightnesses between those of the lit part of the map."""
    return even_levels(found.radiance, 11, float(found.radiance[found.radiance > 0].min()))


def figure_25() -> PaperFigure:
    """Reflectance maps of a Lambertian and a very rough surface."""
    maps = {
        "(a) Lambert’s law": _map(partial(MODELS["lambert"].brdf, albedo=ALBEDO)),
        "(b) σ = 60°": _map(partial(EXACT, albedo=ALBEDO, sigma_deg=60.0)),
    }
    flat, rough = (found.plane_r2 for found in maps.values())
    zero = _map(partial(EXACT, albedo=ALBEDO, sigma_deg=0.0)).radiance
    same = float(np.max(np.abs(zero - next(iter(maps.values())).radiance)))
    far = [
        reflectance_map(brdf, (light(60.0, 45.0),), reach=1.5, size=61).plane_r2
        for brdf in (
            partial(MODELS["lambert"].brdf, albedo=ALBEDO),
            partial(EXACT, albedo=ALBEDO, sigma_deg=60.0),
        )
    ]
    return PaperFigure(
        number="25",
        title="Reflectance maps",
        caption=(
            "Lines of equal brightness over the gradient (p, q) of the surface; lamp at "
            "θ<sub>i</sub> = 10°, φ<sub>i</sub> = 45°, albedo 0.9; (b) by the integral (31). R² of "
            "a plane through the brightness within p² + q² ≤ 1.5² measures how linear a map is."
        ),
        panels=tuple(
            contours(title, m.radiance, _levels(m), m.p, m.q, ("p", "q"))
            for title, m in maps.items()
        ),
        checks=(
            Check(
                "the map of the very rough surface is much like the linear one of the moon",
                f"R² of a plane {rough:.2f}, for Lambert’s law {flat:.2f}",
                abs(rough - 0.82) < 0.01 and abs(flat - 0.33) < 0.01,
            ),
            Check(
                "σ = 0 gives the map of Lambert’s law",
                f"differs by {same:.1g}",
                same < 1e-12,
            ),
            Check(
                "the map becomes linear only if the viewer is close to the lamp",
                f"with the lamp at 60°, R² is {far[1]:.2f}, for Lambert’s law {far[0]:.2f}",
                far[1] < 0.9 * rough,
                "By this measure it does not: with an oblique lamp the map of any material comes "
                "close to a plane, so that roughness no longer makes the difference.",
            ),
        ),
    )
