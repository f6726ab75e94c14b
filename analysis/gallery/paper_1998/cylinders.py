"""Figures 6 to 10 of the 1998 paper: brightness across rough and smooth cylinders."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.curves import peak_at, rises, spread
from analysis.gallery.figure import Check, PaperFigure, close
from analysis.gallery.panels import Axis, Line, chart
from analysis.gallery.paper_1995.gaussian_slopes import QUALITATIVE
from analysis.gallery.paper_1995.vase import (
    BRIGHTNESS,
    CLAY,
    LAMBERT,
    PLACE,
    brightness,
    flatness,
    picture_lines,
    shifted_peak,
)
from analysis.gallery.paper_1998.plane import SMOOTH, WOLFF
from analysis.rendering.cross_section import across
from analysis.rendering.light import light
from analysis.report.style import short_number

CUP = partial(WOLFF, single_scattering_albedo=0.9, n=1.5)
"""The smooth cup of Figures 8 and 9; the paper states neither albedo nor index."""


def figure_6() -> PaperFigure:
    """Rough cylinder, lit from the viewer."""
    angles = np.linspace(1.0, 85.0, 85)
    gain = brightness(CLAY, 0.0, angles) / brightness(LAMBERT, 0.0, angles)
    return PaperFigure(
        number="6",
        title="A rough cylinder, lit from the viewer",
        caption=(
            "Brightness across the picture, θ<sub>i</sub> = 0°, by the integral behind (5); the "
            "paper states no roughness: σ = 40° and albedo 0.7 as for the clay vase of 1995. The "
            "measured points are left out."
        ),
        panels=(chart("", picture_lines("σ = 40°", CLAY, 0.0), PLACE, BRIGHTNESS),),
        checks=(
            *flatness(),
            Check(
                "a rough object is brighter than by Lambert’s law, and looks flatter",
                f"by factors of {gain[29]:.2f} and {gain[59]:.2f} at 30° and 60°",
                rises(gain) and gain[0] >= 1,
            ),
        ),
    )


def figure_7() -> PaperFigure:
    """Smooth cylinder, lit from the viewer."""
    angles = np.linspace(1.0, 89.0, 89)
    loss = brightness(SMOOTH, 0.0, angles) / brightness(LAMBERT, 0.0, angles)
    return PaperFigure(
        number="7",
        title="A smooth cylinder, lit from the viewer",
        caption=(
            "As Figure 6, by Wolff’s model (7): n = 1.5, single-scattering albedo 1; the paper "
            "states neither."
        ),
        panels=(chart("", picture_lines("Wolff", SMOOTH, 0.0), PLACE, BRIGHTNESS),),
        checks=(
            Check(
                "a smooth object is darker than by Lambert’s law, significantly so at large "
                "angles, and looks rounder",
                f"by factors of {loss[29]:.2f}, {loss[59]:.2f} and {loss[79]:.2f} at 30°, 60° and "
                "80°",
                rises(-loss) and loss[59] < 0.9,
            ),
        ),
    )


def figure_8() -> PaperFigure:
    """Smooth cylinder, lit from the side, against the orientation of the surface."""
    angles = np.linspace(0.0, 90.0, 1801)
    smooth, white, flat = (across(b, (light(90.0),), angles) for b in (CUP, SMOOTH, LAMBERT))
    scale = smooth[900] / flat[900] / smooth.max()  # equal at 45 degrees
    lines = (
        Line(angles, smooth / smooth.max(), "Wolff", 0),
        Line(angles, flat * scale, "Lambert", 4, thin=True),
    )
    inside = angles < 90
    return PaperFigure(
        number="8",
        title="A smooth cylinder, lit from the side, against the orientation of its surface",
        caption=(
            "Lamp at 90° to the viewer; 0° is the middle of the cylinder, 90° its limb on the "
            "lamp’s side. By Wolff’s model (7), n = 1.5, single-scattering albedo 0.9; Lambert’s "
            "law is scaled to it at 45°. The measured points are left out."
        ),
        panels=(
            chart(
                "",
                lines,
                Axis("surface turned from the viewer by (°)", (0.0, 90.0)),
                Axis("radiance, largest = 1", (0.0, 1.3)),
                ((peak_at(angles, smooth), "largest"),),
            ),
        ),
        checks=(
            close(
                "the radiance has its maximum where the surface is turned by about 65°",
                65.0,
                peak_at(angles, smooth),
                0.5,
                "°",
            ),
            close(
                "also for a white one, of single-scattering albedo 1",
                65.0,
                peak_at(angles, white),
                0.5,
                "°",
            ),
            Check(
                "it is least at the limb, contrary to Lambert’s law, by which it is largest there",
                f"{smooth[-2] / smooth.max():.3f} of the largest at 89.95°; Lambert’s rises all "
                "the way",
                bool(smooth[-2] < 0.05 * smooth.max()) and rises(flat[inside]),
            ),
        ),
    )


def figure_9() -> PaperFigure:
    """Smooth cylinder, lit from the side, against the place on the picture."""
    x = np.linspace(0.0, 0.99999, 2001)
    angles = np.degrees(np.arcsin(x))
    smooth, flat = (across(b, (light(90.0),), angles) for b in (CUP, LAMBERT))
    scale = float(np.interp(np.sin(np.radians(45.0)), x, smooth / np.maximum(flat, 1e-9)))
    lines = (
        Line(x, smooth / smooth.max(), "Wolff", 0),
        Line(x, flat * scale / smooth.max(), "Lambert", 4, thin=True),
    )
    return PaperFigure(
        number="9",
        title="The same against the place on the picture",
        caption="As Figure 8, equation (7), over the pixel; x is 0 in the middle, R at the limb.",
        panels=(
            chart(
                "",
                lines,
                Axis("place on the cylinder’s picture, x/R", (0.0, 1.0)),
                Axis("radiance, largest = 1", (0.0, 1.3)),
            ),
        ),
        checks=(
            close(
                "the maximum of Figure 8 lies at sin 65° of the radius",
                float(np.sin(np.radians(65.0))),
                peak_at(x, smooth),
                0.004,
            ),
        ),
    )


def figure_10() -> PaperFigure:
    """Rough cylinder, lit from 20 degrees beside the viewer."""
    return PaperFigure(
        number="10",
        title="A rough cylinder, lit from 20° beside the viewer",
        caption=(
            "As Figure 6, equation (5), for a lamp 20° to the right. The measured points are left "
            "out."
        ),
        panels=(chart("", picture_lines("σ = 40°", CLAY, 20.0), PLACE, BRIGHTNESS),),
        checks=(*shifted_peak(), _proportional_from_the_side(), _smooth_agrees()),
    )


def _proportional_from_the_side() -> Check:
    angles = np.linspace(5.0, 85.0, 81)
    flat = across(LAMBERT, (light(90.0),), angles)
    short, whole = (
        spread(across(b, (light(90.0),), angles) / flat)
        for b in (partial(QUALITATIVE, albedo=0.7, sigma_deg=40.0), CLAY)
    )
    return Check(
        "as the lamp moves to 90°, the brightness of a rough cylinder becomes that of Lambert’s "
        "law times a factor (section 3.1)",
        f"their ratio is constant to ±{short_number(100 * short / 2, 1)} % by (6), to "
        f"±{100 * whole / 2:.0f} % by the integral",
        whole < 0.15,
    )


def _smooth_agrees() -> Check:
    angles = np.linspace(-30.0, 85.0, 231)
    ratio = brightness(SMOOTH, 20.0, angles) / brightness(LAMBERT, 20.0, angles)
    within, beyond = (float(np.interp(20.0 + t, angles, ratio)) for t in (45.0, 62.0))
    return Check(
        "a smooth cylinder agrees much better with Lambert’s law, until the incidence exceeds 50°",
        f"Wolff’s over Lambert’s {within:.2f} at an incidence of 45°, {beyond:.2f} at 62°",
        within > 0.85 > beyond,
    )
