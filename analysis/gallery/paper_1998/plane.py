"""Figures 1, 3, 4 and 5 of the 1998 paper: reflection of flat rough and smooth surfaces."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.figure import Check, PaperFigure, close
from analysis.gallery.panels import VIEW, Axis, Line, chart
from analysis.gallery.paper_1991.framework import component_panel
from analysis.gallery.paper_1991.physical_optics import spike_and_lobe
from analysis.gallery.paper_1995.gaussian_slopes import EXACT, radiance
from analysis.gallery.paper_1995.samples import INCIDENCES, normalised
from analysis.models import MODELS
from analysis.models.smooth.fresnel import unpolarised
from analysis.report.style import short_number
from instrument.geometry import Brdf

WOLFF = MODELS["wolff"].brdf
SMOOTH = partial(WOLFF, single_scattering_albedo=1.0, n=1.5)
"""A white smooth dielectric; the paper states neither albedo nor index of its samples."""

_OXIDE = partial(WOLFF, single_scattering_albedo=1.0, n=1.74)  # index of magnesium oxide
_SANDPAPER = partial(EXACT, albedo=0.80, sigma_deg=40.0)  # albedo: Oren and Nayar 1995, figure 17
_THETA_R = np.linspace(-85.0, 85.0, 341)
_X = Axis(VIEW, (-90.0, 90.0))
_Y = Axis("L(θᵣ)/L(0)", (0.0, None))


def figure_1() -> PaperFigure:
    """Lobes of the three components in polar form."""
    angle = np.array([40.0])
    smooth, rough = (
        tuple(float(part[0]) for part in spike_and_lobe(s, 40.0, angle)) for s in (0.002, 0.5)
    )
    return PaperFigure(
        number="1",
        title="The three components of reflection",
        caption=(
            "Specular spike, specular lobe and body reflection in the direction of the viewer, for "
            "light from 40°; the body reflects by Lambert’s law (1). The strengths are chosen, as "
            "in the paper. Its sketches (a) to (c) are left out."
        ),
        panels=(component_panel(moving_camera=True),),
        checks=(
            Check(
                "of the two surface components the spike dominates on smooth surfaces, the lobe on "
                "rough ones",
                f"spike over lobe {short_number(smooth[0] / smooth[1], 2)} at σ<sub>h</sub>/λ = "
                f"0.002, {short_number(rough[0] / rough[1], 2)} at 0.5 (1991, equation (52))",
                smooth[0] > 100 * smooth[1] and rough[0] < 0.01 * rough[1],
            ),
            close(
                "the Fresnel factor (2) attenuates the spike: ((n − 1)/(n + 1))² at normal "
                "incidence, n = 1.5",
                0.04,
                float(unpolarised(0.0, 1.5)),
                1e-12,
            ),
        ),
    )


def figure_3() -> PaperFigure:
    """Rough surface at several incidences."""
    lines = [
        Line(_THETA_R, normalised(_SANDPAPER, t, _THETA_R), f"θᵢ {t:g}°", k)
        for k, t in enumerate(INCIDENCES)
    ]
    lines.append(Line(_THETA_R, np.ones_like(_THETA_R), "Lambert", 4, thin=True))
    return PaperFigure(
        number="3",
        title="A rough surface, painted sandpaper",
        caption=(
            "Radiance over that along the normal by the integral of which (3) and (4) are the "
            "functional form, σ = 40°; albedo 0.8 and incidences are those of the 1995 paper. The "
            "measured points are left out."
        ),
        panels=(chart("", lines, _X, _Y),),
        checks=(_asymmetry(),),
    )


def _asymmetry() -> Check:
    both = np.array([-60.0, 60.0])
    forward, backward = zip(*(normalised(_SANDPAPER, t, both) for t in INCIDENCES), strict=True)
    return Check(
        "with growing view angle the radiance increases on the lamp’s side of the normal and "
        "decreases on the other",
        "at 60° and −60°: "
        + ", ".join(f"{b:.2f} and {f:.2f}" for f, b in zip(forward, backward, strict=True))
        + " of that along the normal (incidences 30°, 45°, 60°)",
        min(backward) > 1 > max(forward),
    )


def figure_4() -> PaperFigure:
    """Smooth surface at normal incidence."""
    lines = (
        Line(_THETA_R, normalised(_OXIDE, 0.0, _THETA_R), "Wolff", 0),
        Line(_THETA_R, np.ones_like(_THETA_R), "Lambert", 4, thin=True),
    )
    return PaperFigure(
        number="4",
        title="A smooth surface, white magnesium oxide, at normal incidence",
        caption=(
            "Radiance over that along the normal by Wolff’s model (7), with ϱ of (8): n = 1.74, "
            "that of magnesium oxide, and a single-scattering albedo of 1; the paper states "
            "neither. The measured points are left out."
        ),
        panels=(chart("", lines, _X, _Y),),
        checks=(_falling(_OXIDE, (0.0,)), _symmetric(_OXIDE, (0.0,))),
    )


def _falling(brdf: Brdf, incidences: tuple[float, ...]) -> Check:
    x = np.linspace(0.0, 90.0, 181)
    curves = [radiance(brdf, t, x) for t in incidences]
    ends = [float(y[140] / y[0]) for y in curves]
    rise = max(float(y.max() / y[0] - 1) for y in curves)
    grey = radiance(partial(WOLFF, single_scattering_albedo=0.9, n=1.5), 0.0, x)
    return Check(
        "a smooth surface has its largest radiance along the normal, from where it falls "
        "monotonically on both sides",
        f"{', '.join(f'{e:.2f}' for e in ends)} of it at 70°; before, it rises by at most "
        f"{short_number(100 * rise, 2)} %",
        rise < 0.005,
        f"One that scatters less, 0.9, rises by {100 * (grey.max() / grey[0] - 1):.0f} % up to "
        f"{x[int(np.argmax(grey))]:.0f}°, as ϱ of (8) depends on the angles.",
    )


def _symmetric(brdf: Brdf, incidences: tuple[float, ...]) -> Check:
    x = np.linspace(1.0, 89.0, 89)
    worst = 0.0
    for t in incidences:
        curves = [radiance(brdf, t, sign * x, dphi) for sign, dphi in ((1, 0), (-1, 0), (1, 73.0))]
        worst = max(worst, *(float(np.max(np.abs(y / curves[0] - 1))) for y in curves[1:]))
    return Check(
        "the radiance is symmetric about the normal and the same at every azimuth",
        f"differs by {short_number(worst, 1)}",
        worst < 1e-9,
    )


def figure_5() -> PaperFigure:
    """Smooth surface under the conditions of Figure 3."""
    lines = [
        Line(_THETA_R, normalised(SMOOTH, t, _THETA_R), f"θᵢ {t:g}°", k)
        for k, t in enumerate(INCIDENCES)
    ]
    return PaperFigure(
        number="5",
        title="A smooth surface under the conditions of Figure 3",
        caption=(
            "As Figure 3, by Wolff’s model (7): n = 1.5, single-scattering albedo 1. The three "
            "curves lie within a line’s width, as the model is nearly a product of a function of "
            "θ<sub>i</sub> and one of θ<sub>r</sub>. The caption in print refers to Figure 2 for "
            "Figure 3."
        ),
        panels=(chart("", lines, _X, _Y),),
        checks=(
            _falling(SMOOTH, INCIDENCES),
            _symmetric(SMOOTH, INCIDENCES),
        ),
    )
