"""Figures 15 to 17 of the 1991 paper: a moving source, and the three components of reflection."""

from __future__ import annotations

import math

import numpy as np

from analysis.gallery.curves import peak_at, spread, towards_mirror
from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import Axis, Line, chart, polar
from analysis.models.specular.beckmann_spizzichino import rough_lobe_brdf
from analysis.models.specular.surface_statistics import slope_sigma_deg
from analysis.models.specular.unified import moving_sensor, moving_source
from analysis.report.style import short_number
from instrument.geometry import FloatArray, Geometry

_VIEWS = (0.0, 20.0, 40.0, 60.0)  # degrees; the text states none
_SLOPES = (0.02, 0.066, 0.1)  # sigma_h / T; the text states none
_ROUGH = 10.0  # sigma_h in wavelengths: far into the rough limit
_SOURCE_AXIS = "source angle θᵢ (°), + on the mirror side"

_ANGLE = 40.0  # degrees: of the fixed source or camera in Figs. 16 and 17
_LOBE, _WIDTH = 0.62, 7.0  # strength of the lobe over the diffuse one's, sigma in degrees
_DIFFUSE = 0.36
_SPIKE_WIDTH = 0.6  # degrees


def _physical(slope: float, theta_r: float, theta_i: FloatArray) -> FloatArray:
    """Radiance (53) over its peak at a fixed view angle, for signed source angles (N,)."""
    at = _from_source(theta_r, theta_i)
    radiance = np.cos(at.theta_i) * rough_lobe_brdf(at, 1.0, _ROUGH, _ROUGH / slope)
    return np.asarray(radiance * (4 * math.pi * (2 * slope) ** 2))


def _geometrical(slope: float, theta_r: float, theta_i: FloatArray) -> FloatArray:
    """Radiance (54) of the slopes that (60) makes equivalent, 1/cos of the view angle at most."""
    sigma = slope_sigma_deg(_ROUGH, _ROUGH / slope)
    return moving_sensor(_from_source(theta_r, theta_i), 0.0, 1.0, sigma, 0.0, 1.0)


def _from_source(theta_r: float, theta_i: FloatArray) -> Geometry:
    """Geometry for a fixed camera."""
    sign = np.where(np.asarray(theta_i) < 0, -1.0, 1.0)
    return towards_mirror(np.abs(theta_i), sign * theta_r)


def _moving(slope: float, *, physical: bool) -> Panel:
    x = np.linspace(-90.0, 90.0, 721)
    model = _physical if physical else _geometrical
    lines = [Line(x, model(slope, t, x), f"θᵣ {t:g}°", k) for k, t in enumerate(_VIEWS)]
    sigma = slope_sigma_deg(_ROUGH, _ROUGH / slope)
    title = (
        f"Beckmann–Spizzichino, σ<sub>h</sub>/T = {slope:g}"
        if physical
        else f"Torrance–Sparrow, σ<sub>α</sub> = {sigma:.2f}°"
    )
    return chart(
        title,
        lines,
        Axis(_SOURCE_AXIS, (-30.0, 90.0)),
        Axis("radiance (relative)", (0.0, 2.1)),
    )


def figure_15() -> PaperFigure:
    """Lobes of both models for a moving source and a fixed camera."""
    panels = [_moving(s, physical=p) for s in _SLOPES for p in (True, False)]
    return PaperFigure(
        number="15",
        title="Both lobes for a moving source and a fixed camera",
        caption=(
            "Left: lobe of Beckmann and Spizzichino for rough surfaces, equation (53). Right: of "
            "Torrance and Sparrow, equation (54), with σ<sub>α</sub> from σ<sub>h</sub>/T by "
            "equation (60). No attenuation, constant Fresnel factor. The text states neither the "
            "ratios nor the view angles."
        ),
        panels=tuple(panels),
        checks=(_peaks(), _symmetry(), _gaussian(), _alike()),
    )


def _peaks() -> Check:
    x = np.linspace(-10.0, 89.0, 9901)
    off = max(
        abs(peak_at(x, model(slope, t, x)) - t)
        for slope in _SLOPES
        for t in _VIEWS
        for model in (_physical, _geometrical)
    )
    return Check(
        "with a moving source each curve has its peak in the mirror direction, θ<sub>i</sub> = "
        "θ<sub>r</sub>: none lies beyond",
        f"largest distance {short_number(off, 1)}°",
        off < 1e-3,
    )


def _symmetry() -> Check:
    off = np.linspace(0.1, 25.0, 250)
    worst = 0.0
    for model in (_physical, _geometrical):
        for slope in _SLOPES:
            up, down = (model(slope, 40.0, 40.0 + sign * off) for sign in (1, -1))
            worst = max(worst, float(np.max(np.abs(up - down))))
    return Check(
        "the curves are symmetric about it",
        f"the two sides differ by {short_number(worst, 1)} of the peak",
        worst < 1e-9,
    )


def _gaussian() -> Check:
    x = np.linspace(10.0, 70.0, 601)
    worst = 0.0
    for slope in _SLOPES:
        sigma = slope_sigma_deg(_ROUGH, _ROUGH / slope)
        gauss = np.exp(-0.5 * ((x - 40.0) / (2 * sigma)) ** 2) / math.cos(math.radians(40.0))
        for model in (_physical, _geometrical):
            found = model(slope, 40.0, x)
            worst = max(worst, float(np.max(np.abs(found - gauss)) / np.max(gauss)))
    return Check(
        "in the plane of source, camera and normal the curves can be represented by Gaussians",
        f"within {100 * worst:.1f} % of the peak",
        worst < 0.05,
    )


def _alike() -> Check:
    x = np.linspace(-30.0, 89.0, 1191)
    worst = [
        max(
            float(np.max(np.abs(_physical(s, t, x) - _geometrical(s, t, x))))
            * math.cos(math.radians(t))
            for t in _VIEWS
        )
        for s in _SLOPES
    ]
    return Check(
        "the diagrams of the two models resemble each other strongly: (60) relates their roughness "
        "well",
        "they differ by at most "
        + ", ".join(f"{100 * w:.1f} %" for w in worst)
        + " of the peak at σ<sub>h</sub>/T = "
        + ", ".join(f"{s:g}" for s in _SLOPES),
        max(worst) < 0.05,
    )


def _components(moving_camera: bool, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Diffuse component and lobe, (N,), over the length of the spike."""
    if moving_camera:
        at = towards_mirror(_ANGLE, angle)
        parts = ((_DIFFUSE, 0.0), (0.0, _LOBE * math.cos(math.radians(_ANGLE))))
        found = [moving_sensor(at, dl, sl, _WIDTH, 0.0, 1.0) for dl, sl in parts]
    else:
        at = _from_source(_ANGLE, angle)
        found = [
            moving_source(at, dl, sl, _WIDTH, 0.0, 1.0)
            for dl, sl in ((_DIFFUSE, 0.0), (0.0, _LOBE))
        ]
    return found[0], found[1]


def _spike(angle: FloatArray) -> FloatArray:
    """Spike at angles (N,) in degrees on the mirror side, 1 at its peak."""
    at = towards_mirror(_ANGLE, angle)
    whole = moving_sensor(at, 0.0, 0.0, _WIDTH, 1.0, _SPIKE_WIDTH)
    return whole * (2 * math.pi * math.radians(_SPIKE_WIDTH) ** 2)


def component_panel(*, moving_camera: bool) -> Panel:
    """Polar panel of the three components, for a moving camera or a moving source."""
    angle = np.linspace(-90.0, 85.0, 701)
    fine = np.linspace(_ANGLE - 3, _ANGLE + 3, 121)
    diffuse, lobe = _components(moving_camera, angle)
    lines = (
        Line(fine, _spike(fine), "specular spike", 1),
        Line(angle, lobe, "specular lobe", 0),
        Line(angle, diffuse, "diffuse lobe", 2),
    )
    return polar("", lines, ((-_ANGLE, "source" if moving_camera else "camera"),))


def figure_16() -> PaperFigure:
    """Three components in the direction of a moving camera."""
    x = np.linspace(20.0, 80.0, 6001)
    beyond = peak_at(x, _components(True, x)[1]) - _ANGLE
    diffuse = _components(True, x)[0]
    fine = np.linspace(35.0, 45.0, 10001)
    at = peak_at(fine, _spike(fine))
    return PaperFigure(
        number="16",
        title="The three components in the direction of a moving camera",
        caption=(
            "Diffuse lobe, specular lobe and specular spike, the terms of equation (61), in the "
            "direction of the camera for a fixed source (at 40°, left). The strengths are free in "
            "the paper; the delta of the spike is here a Gaussian 0.6° wide, as the paper allows."
        ),
        panels=(component_panel(moving_camera=True),),
        checks=(
            Check(
                "the specular lobe has its peak beyond the mirror direction at large roughness",
                f"{beyond:.1f}° beyond 40° at σ<sub>α</sub> = {_WIDTH:g}°",
                beyond > 1,
            ),
            Check(
                "the spike is concentrated about the mirror direction",
                f"peak at {at:.2f}°",
                abs(at - _ANGLE) < 0.01,
            ),
            Check(
                "the diffuse lobe, Lambert’s, does not depend on the view angle",
                f"varies by {short_number(spread(diffuse), 1)}",
                spread(diffuse) < 1e-12,
            ),
        ),
    )


def figure_17() -> PaperFigure:
    """Three components in the direction of a moving source."""
    off = np.linspace(0.1, 30.0, 300)
    up, down = (_components(False, _ANGLE + sign * off)[1] for sign in (1, -1))
    angle = np.array([0.0, 60.0])
    diffuse = _components(False, angle)[0]
    asymmetry = float(np.max(np.abs(up - down)) / _LOBE)
    ratio = float(diffuse[1] / diffuse[0])
    return PaperFigure(
        number="17",
        title="The three components in the direction of a moving source",
        caption=(
            "The terms of equation (62) in the direction of the source for a fixed camera (at 40°, "
            "left)."
        ),
        panels=(component_panel(moving_camera=False),),
        checks=(
            Check(
                "the diffuse component is proportional to the irradiance, cos θ<sub>i</sub>",
                f"at 60° {ratio:.4f} of that at 0°",
                abs(ratio - 0.5) < 1e-12,
            ),
            Check(
                "the specular lobe is symmetric about θ<sub>i</sub> = θ<sub>r</sub>",
                f"the two sides differ by {short_number(asymmetry, 1)} of the peak",
                asymmetry < 1e-9,
            ),
        ),
    )
