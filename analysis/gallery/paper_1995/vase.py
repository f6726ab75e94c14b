"""Brightness across a vase, and Figure 24 of the 1995 paper."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.curves import peak_at
from analysis.gallery.figure import Check, PaperFigure, close
from analysis.gallery.panels import Axis, Line, chart
from analysis.gallery.paper_1995.gaussian_slopes import EXACT
from analysis.models import MODELS
from analysis.rendering.cross_section import across
from analysis.rendering.light import HEADLIGHT, light
from instrument.geometry import Brdf, FloatArray

CLAY = partial(EXACT, albedo=0.70, sigma_deg=40.0)
"""The clay vase of 1995."""

LAMBERT = partial(MODELS["lambert"].brdf, albedo=0.70)
PLACE = Axis("place on the cylinder’s picture, x/R", (-1.0, 1.0), (-1, -0.5, 0, 0.5, 1))
BRIGHTNESS = Axis("brightness, middle = 1", (0.0, None))
_X = np.sin(np.radians(np.linspace(-89.9, 89.9, 361)))


def brightness(brdf: Brdf, lamp_deg: float, angles_deg: FloatArray) -> FloatArray:
    """Brightness, relative to that in the middle, at angles (N,) in degrees from the viewer."""
    lamp = light(lamp_deg) if lamp_deg else HEADLIGHT
    whole = across(brdf, (lamp,), np.concatenate([angles_deg, [0.0]]))
    return np.asarray(whole[:-1] / whole[-1])


def across_picture(brdf: Brdf, lamp_deg: float) -> FloatArray:
    """Brightness (361,), relative to the middle, at the places on the picture."""
    return brightness(brdf, lamp_deg, np.degrees(np.arcsin(_X)))


def picture_lines(name: str, brdf: Brdf, lamp_deg: float) -> tuple[Line, Line]:
    """Lines of a BRDF, as `Model.brdf`, and of Lambert's law across a cylinder's picture."""
    return (
        Line(_X, across_picture(brdf, lamp_deg), name, 0),
        Line(_X, across_picture(LAMBERT, lamp_deg), "Lambert", 4, thin=True),
    )


def flatness() -> tuple[Check, Check]:
    """Checks of the brightness where the surface is turned by 60 degrees: rough and Lambert's."""
    at = np.array([60.0])
    rough, flat = (float(brightness(brdf, 0.0, at)[0]) for brdf in (CLAY, LAMBERT))
    return (
        Check(
            "the brightness of the rough cylinder is nearly constant over most of its width and "
            "drops next to the limbs",
            f"{rough:.2f} of that in the middle where the surface is turned by 60°, 87 % of the "
            "way to the limb",
            abs(rough - 0.85) < 0.01,
        ),
        close("Lambert’s law makes it fall to cos 60° there", 0.5, flat, 1e-9),
    )


def shifted_peak() -> tuple[Check, Check]:
    """Checks of the brightness for a lamp at 20 degrees: the peak and the right limb."""
    angles = np.linspace(-60.0, 89.0, 1491)
    rough, flat = (brightness(b, 20.0, angles) for b in (CLAY, LAMBERT))
    peaks = peak_at(angles, rough), peak_at(angles, flat)
    right = [float(np.interp(75.0, angles, y / y.max())) for y in (rough, flat)]
    return (
        Check(
            "the peak by Lambert’s law, where the surface faces the lamp, is far from that of the "
            "rough cylinder",
            f"at {peaks[1]:.1f}° and {peaks[0]:.1f}° from the viewer",
            abs(peaks[1] - 20) < 0.1 and peaks[0] > 25,
        ),
        Check(
            "by Lambert’s law the brightness near the right limb drops much faster",
            f"at 75° to {right[1]:.2f} of the largest; on the rough cylinder to {right[0]:.2f}",
            right[0] > 1.3 * right[1],
        ),
    )


def figure_24() -> PaperFigure:
    """Brightness across the vase."""
    return PaperFigure(
        number="24",
        title="Brightness across the clay vase",
        caption=(
            "Cylindrical body, by the integral (31) with σ = 40°, albedo 0.7, and by Lambert’s "
            "law; (a) lit from the viewer, (b) from 20° to the right. The photograph’s curve is "
            "left out."
        ),
        panels=(
            chart("(a)", picture_lines("σ = 40°", CLAY, 0.0), PLACE, BRIGHTNESS),
            chart("(b)", picture_lines("σ = 40°", CLAY, 20.0), PLACE, BRIGHTNESS),
        ),
        checks=(*flatness(), *shifted_peak()),
    )
