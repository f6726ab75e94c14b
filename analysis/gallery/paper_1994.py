"""Figures of Oren and Nayar 1994: some of those of 1995, and rendered objects."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.figure import Check, Paper, PaperFigure
from analysis.gallery.paper_1995 import gaussian_slopes, samples, vase
from analysis.gallery.paper_1998.spheres import rough, spheres_flatten
from analysis.gallery.pictures import SIZE, pictures
from analysis.rendering.light import HEADLIGHT
from analysis.rendering.render import radiance, render
from analysis.rendering.shapes import cube, cylinder, sphere
from analysis.rendering.shapes import vase as vase_shape
from instrument.geometry import FloatArray


def figure_5() -> PaperFigure:
    """Radiance with and without interreflection."""
    return gaussian_slopes.figure_10().renumbered(
        "5",
        "Figure 10 of 1995: radiance by the integral (13) over Gaussian slopes of σ = 30°, direct "
        "light (6) and two bounces (10); albedo 0.9, incidence 75°.",
    )


def figure_6() -> PaperFigure:
    """BRDF for several incidences and planes."""
    return gaussian_slopes.figure_12().renumbered(
        "6",
        "Figure 12 of 1995: by the integral (13), σ = 40°, albedo 0.9; (b) at incidence 75°. The "
        "text states neither the incidences nor the azimuths.",
    )


def figure_8() -> PaperFigure:
    """Wall plaster."""
    return samples.figure_16().renumbered(
        "8",
        "Figure 16 of 1995: by the integral (13), σ = 30°, albedo 0.9, incidences 30°, 45°, 60°. "
        "The measured points are left out.",
    )


def figure_9() -> PaperFigure:
    """White sand."""
    return samples.figure_18().renumbered(
        "9",
        "Figure 18 of 1995: by the integral (13), σ = 35°, albedo 0.8. The measured "
        "points are left out.",
    )


def figure_12() -> PaperFigure:
    """Rendered vases."""
    surface = vase_shape(SIZE)
    images = [
        render(surface, brdf, (HEADLIGHT,)) for brdf in (vase.LAMBERT, rough(40.0, albedo=0.70))
    ]
    return PaperFigure(
        number="12",
        title="The clay vase by Lambert’s law and by the model",
        caption=(
            "Lit from the viewer; (b) by Lambert’s law, (c) by the integral (13) with σ = 40°, "
            "albedo 0.7. The photograph (a) is left out; the vase’s cylindrical body is that of "
            "the paper, its foot and neck are made up. Each picture’s largest brightness is white."
        ),
        panels=(pictures("", [_scaled(i) for i in images], ("(b) Lambert", "(c) σ = 40°")),),
        checks=vase.flatness(),
    )


def _scaled(image: FloatArray) -> FloatArray:
    return np.asarray(image / np.nanmax(image))


def figure_13() -> PaperFigure:
    """Brightness across the vase."""
    return vase.figure_24().renumbered(
        "13",
        "Figure 24 of 1995: by the integral (13) with σ = 40°, albedo 0.7, and by Lambert’s law; "
        "(a) lit from the viewer, (b) from 20° to the right. The photograph’s curve is left out.",
    )


def figure_14() -> PaperFigure:
    """Spheres of three roughnesses."""
    images = [render(sphere(SIZE), rough(s), (HEADLIGHT,)) for s in (0.0, 20.0, 40.0)]
    return PaperFigure(
        number="14",
        title="Spheres of three roughnesses",
        caption=(
            "Lit from the viewer, by the integral (13), albedo 0.9; the roughnesses are those of "
            "Figure 3 of 1995, which shows the same."
        ),
        panels=(pictures("", [_scaled(i) for i in images], ("σ = 0°", "σ = 20°", "σ = 40°")),),
        checks=(spheres_flatten(),),
    )


def figure_15() -> PaperFigure:
    """Three objects of one material."""
    shapes = (vase_shape(SIZE), cube(SIZE), cylinder(SIZE))
    panels = []
    for letter, sigma in (("a", 0.0), ("b", 30.0)):
        images = [render(shape, rough(sigma), (HEADLIGHT,)) for shape in shapes]
        white = max(float(np.nanmax(image)) for image in images)
        panels.append(pictures(f"({letter}) σ = {sigma:g}°", [image / white for image in images]))
    return PaperFigure(
        number="15",
        title="Three objects of one roughness",
        caption=(
            "Lit from the viewer, by the integral (13), albedo 0.9. The objects are the program’s "
            "own: the text names none."
        ),
        panels=tuple(panels),
        checks=(_contrast(),),
    )


def _contrast() -> Check:
    """Brightness of the cube's faces; light from the viewer, so that each depends on its tilt."""
    solid = cube(61)
    normals = np.unique(np.round(solid.normal[solid.seen], 9), axis=0)
    ratios = []
    for sigma in (0.0, 30.0):
        brdf = partial(gaussian_slopes.EXACT, albedo=0.9, sigma_deg=sigma)
        faces = radiance(normals, brdf, (HEADLIGHT,))
        ratios.append(float(faces.min() / faces.max()))
    return Check(
        "roughness flattens the shading of all objects alike",
        f"the cube’s darkest face over its brightest {ratios[0]:.2f} at 0°, {ratios[1]:.2f} at 30°",
        ratios[1] > ratios[0] + 0.1,
    )


PAPER = Paper(
    key="1994",
    citation="Oren and Nayar 1994: Generalization of Lambert’s Reflectance Model",
    figures=(
        figure_5, figure_6, figure_8, figure_9, figure_12, figure_13, figure_14, figure_15,
    ),
    left_out=(
        "Figures 1 (photograph), 2–4 (sketches; 3 and 4 are Figures 5 and 7 of 1995), 7 (the rig), "
        "10 and 11 (measured samples, Figures 20 and 21 of 1995); of the others photographs and "
        "measured points."
    ),
)  # fmt: skip
