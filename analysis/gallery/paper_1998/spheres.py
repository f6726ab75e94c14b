"""Figures 11 to 15 of the 1998 paper: rendered balls, isophotes, reflectance maps, solids."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.curves import spread
from analysis.gallery.figure import Check, PaperFigure, close
from analysis.gallery.paper_1995 import vision
from analysis.gallery.paper_1995.gaussian_slopes import EXACT
from analysis.gallery.paper_1995.vase import LAMBERT, brightness
from analysis.gallery.paper_1998.plane import SMOOTH
from analysis.gallery.pictures import SIZE, contours, even_levels, pictures
from analysis.models.rough.oren_nayar_forms import oren_nayar_brdf
from analysis.rendering.light import HEADLIGHT, Light, light
from analysis.rendering.material import Material
from analysis.rendering.render import radiance, render
from analysis.rendering.shapes import cube, cylinder, sphere
from analysis.rendering.surface import Surface
from instrument.geometry import Brdf, FloatArray

_SIDES = (light(-90.0), light(90.0))
_DEFAULT_ALBEDO = 0.9


def rough(sigma_deg: float, albedo: float = _DEFAULT_ALBEDO) -> Material:
    """Material of the integral (31), for pictures."""
    return Material.named("oren_nayar_exact", albedo=albedo, sigma_deg=sigma_deg)


def figure_11() -> PaperFigure:
    """Ball between two lamps."""
    flat, smooth = (_scaled(render(sphere(SIZE), b, _SIDES)) for b in (LAMBERT, SMOOTH))
    bands = [_band(b) for b in (LAMBERT, SMOOTH)]
    return PaperFigure(
        number="11",
        title="A white ball between two lamps",
        caption=(
            "Point lamps at 90° to the left and the right of the viewer; (b) by Lambert’s law (1), "
            "(c) by Wolff’s model (7), n = 1.5, single-scattering albedo 1. The photograph (a) "
            "is left out."
        ),
        panels=(pictures("", (flat, smooth), ("(b) Lambert", "(c) Wolff")),),
        checks=(
            Check(
                "along the shadow boundaries lies a dark band, by Wolff’s model wider than by "
                "Lambert’s law",
                "darker than a tenth of the largest brightness over "
                f"{bands[1]:.3f} of the diameter, by Lambert’s law over {bands[0]:.3f}",
                bands[1] > 1.1 * bands[0],
            ),
        ),
    )


def _scaled(image: FloatArray) -> FloatArray:
    return np.asarray(image / np.nanmax(image))


def _band(brdf: Brdf) -> float:
    """Width of the dark band on the equator over the diameter."""
    x = np.linspace(0.0, 0.9999, 4000)
    normal = np.stack([x, np.zeros_like(x), np.sqrt(1 - x * x)], axis=-1)
    across = radiance(normal, brdf, _SIDES)
    return float(x[np.argmax(across > 0.1 * across.max())])


def figure_12() -> PaperFigure:
    """Isophotes of the ball."""
    panels = []
    for title, brdf in (("(b) Lambert’s law", LAMBERT), ("(c) Wolff", SMOOTH)):
        surface = sphere(2 * SIZE)
        image = render(surface, brdf, _SIDES)
        levels = even_levels(image)
        panels.append(contours(title, image, levels, surface.x, surface.y, outline=True))
    return PaperFigure(
        number="12",
        title="Isophotes of the ball of Figure 11",
        caption=(
            "Lines of equal brightness, at tenths of the largest, by (1) and by (7). The "
            "photograph’s (a) are left out."
        ),
        panels=tuple(panels),
        checks=(_straight_lines(), *_closed_lines()),
    )


def _straight_lines() -> Check:
    y = np.linspace(-0.8, 0.8, 81)
    worst = 0.0
    for x in (0.2, 0.4, 0.55):
        normal = np.stack([np.full_like(y, x), y, np.sqrt(1 - x * x - y * y)], axis=-1)
        worst = max(worst, spread(radiance(normal, LAMBERT, _SIDES)))
    return Check(
        "by Lambert’s law the isophotes are straight lines across the picture",
        f"along lines x = 0.2, 0.4 and 0.55 R the brightness varies by {worst:.1g}",
        worst < 1e-9,
    )


def _closed_lines() -> tuple[Check, Check]:
    x = np.linspace(0.0, 0.99999, 4001)
    normal = np.stack([x, np.zeros_like(x), np.sqrt(1 - x * x)], axis=-1)
    across = radiance(normal, SMOOTH, _SIDES)
    at = float(x[int(np.argmax(across))])
    limb = float(across[-1] / across.max())
    return (
        Check(
            "by Wolff’s model the largest brightness lies inside the limb, within closed lines",
            f"at {at:.3f} R on the equator, by Lambert’s law at the limb",
            0.85 < at < 0.95,
        ),
        Check(
            "and next to the limb the brightness is nearly zero",
            f"{limb:.3f} of the largest at 0.99999 R",
            limb < 0.05,
        ),
    )


def figure_13() -> PaperFigure:
    """Reflectance maps, as in the 1995 paper."""
    return vision.figure_25().renumbered(
        "13",
        "Figure 25 of 1995: lines of equal brightness over the gradient (p, q); lamp at "
        "θ<sub>i</sub> = 10°, φ<sub>i</sub> = 45°, albedo 0.9; (b) by the integral behind (5).",
    )


def figure_14() -> PaperFigure:
    """Smooth and rough solids, lit from near the viewer."""
    above, left = (light(10.0, 90.0),), (light(-18.0),)
    vases = [render(cylinder(SIZE, 12.0), rough(s), above) for s in (5.0, 35.0)]
    cubes = [render(cube(SIZE, 40.0, 25.0), rough(s), left) for s in (7.0, 40.0)]
    balls = [render(sphere(SIZE), rough(s), (HEADLIGHT,)) for s in (0.0, 15.0, 40.0)]
    return PaperFigure(
        number="14",
        title="Solids of equal material, smooth and rough",
        caption=(
            "By the integral behind equation (5), albedo 0.9. (b) cylinders lit from 10° above the "
            "viewer; (d) cubes lit from 18° to the left; (e) spheres lit from the viewer. Each "
            "picture’s largest brightness is white. The photographs (a) and (c) are left out; the "
            "paper does not state the tilt of the solids."
        ),
        panels=(
            pictures("(b)", [_scaled(v) for v in vases], ("σ = 5°", "σ = 35°")),
            pictures("(d)", [_scaled(c) for c in cubes], ("σ = 7°", "σ = 40°")),
            pictures("(e)", [_scaled(b) for b in balls], ("σ = 0°", "σ = 15°", "σ = 40°")),
        ),
        checks=(_faces(cube(61, 40.0, 25.0), left), _flat_cylinders(), spheres_flatten()),
    )


def _faces(solid: Surface, lights: tuple[Light, ...]) -> Check:
    normals = np.unique(np.round(solid.normal[solid.seen], 9), axis=0)
    ratios = []
    for sigma in (7.0, 40.0):
        faces = radiance(normals, partial(EXACT, albedo=0.9, sigma_deg=sigma), lights)
        ratios.append(float(faces.min() / faces.max()))
    return Check(
        "high roughness makes the three faces of a cube almost equally bright",
        f"darkest over brightest face {ratios[1]:.2f} at σ = 40°, {ratios[0]:.2f} at 7°",
        ratios[1] > 0.8,
        "The faces come closer, but a lamp 18° to the side still leaves a third between them.",
    )


def _flat_cylinders() -> Check:
    at = np.array([60.0])
    turned = [
        float(brightness(partial(EXACT, albedo=0.9, sigma_deg=s), 0.0, at)[0]) for s in (5.0, 35.0)
    ]
    return Check(
        "the rougher cylinder looks flatter",
        f"brightness where the surface is turned by 60°: {turned[1]:.2f} of the middle’s at 35°, "
        f"{turned[0]:.2f} at 5°",
        turned[1] > turned[0] + 0.2,
    )


def spheres_flatten() -> Check:
    """Check of the brightness towards the limb of spheres lit from the viewer."""
    at = np.array([60.0])
    edge = [
        float(brightness(partial(EXACT, albedo=0.9, sigma_deg=s), 0.0, at)[0])
        for s in (0.0, 15.0, 20.0, 40.0)
    ]
    return Check(
        "as the roughness grows, the shading of a sphere lit from the viewer becomes flatter, "
        "towards the moon’s disc",
        "brightness at 87 % of the radius "
        + ", ".join(f"{e:.2f}" for e in edge)
        + " of the middle’s at σ = 0°, 15°, 20°, 40°",
        edge == sorted(edge) and abs(edge[0] - 0.5) < 1e-9 and edge[-1] > 0.8,
    )


def figure_15() -> PaperFigure:
    """Cylinder and sphere by three models."""
    above = (light(10.0, 90.0),)
    very_rough = partial(oren_nayar_brdf, albedo=0.9, sigma_deg=70.0)
    cylinders = [render(cylinder(SIZE, 20.0), b, above) for b in (LAMBERT, SMOOTH, very_rough)]
    balls = [render(sphere(SIZE), b, (HEADLIGHT,)) for b in (LAMBERT, SMOOTH, rough(40.0))]
    words = ("Lambert", "Wolff", "Oren–Nayar")
    edges = [_edge(b) for b in (LAMBERT, SMOOTH, very_rough)]
    return PaperFigure(
        number="15",
        title="Cylinder and sphere by three models",
        caption=(
            "From left to right by (1), by (7) and by (5): σ = 70° for the cylinder (functional "
            "form; beyond the integral’s domain of 60°), 40° for the sphere. The cylinder is seen "
            "from 20° above and lit from 10° above the viewer, the sphere from the viewer; the "
            "paper states neither."
        ),
        panels=(
            pictures("", [_scaled(c) for c in cylinders], words),
            pictures("", [_scaled(b) for b in balls], words),
        ),
        checks=(
            Check(
                "the edge between lid and side of the cylinder is stronger by Wolff’s model and "
                "weaker by Oren and Nayar’s than by Lambert’s law",
                f"brightness of the lid over that of the side below it: {edges[1]:.2f}, "
                f"{edges[2]:.2f}, and {edges[0]:.2f} by Lambert’s law",
                edges[1] < edges[0] < edges[2] <= 1.05,
            ),
            *_rounder_and_flatter(),
        ),
    )


def _edge(brdf: Brdf) -> float:
    tilt = np.radians(20.0)
    normals = np.array([[0, np.cos(tilt), np.sin(tilt)], [0, -np.sin(tilt), np.cos(tilt)]])
    lid, side = radiance(normals, brdf, (light(10.0, 90.0),))
    return float(lid / side)


def _rounder_and_flatter() -> tuple[Check, Check]:
    at = np.array([60.0])
    flat, smooth, coarse = (
        float(brightness(b, 0.0, at)[0])
        for b in (LAMBERT, SMOOTH, partial(EXACT, albedo=0.9, sigma_deg=40.0))
    )
    return (
        Check(
            "the smooth sphere looks rounder than by Lambert’s law, the rough one flatter",
            f"brightness at 87 % of the radius {smooth:.2f} and {coarse:.2f} of the middle’s",
            smooth < flat < coarse,
        ),
        close("Lambert’s sphere is half as bright there", 0.5, flat, 1e-9),
    )
