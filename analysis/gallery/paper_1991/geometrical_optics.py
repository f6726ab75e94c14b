"""Figures 11 to 14 of the 1991 paper: Torrance and Sparrow's lobe and its two factors."""

from __future__ import annotations

import numpy as np

from analysis.gallery.curves import around, half_width, peak_at, rises, towards_mirror
from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import MIRROR_SIDE, Axis, Line, chart
from analysis.gallery.paper_1991.physical_optics import INCIDENCES
from analysis.models.smooth.fresnel import reflectances, unpolarised
from analysis.models.specular.beckmann_spizzichino import rough_lobe_brdf
from analysis.models.specular.surface_statistics import height_over_length
from analysis.models.specular.torrance_sparrow import attenuation, torrance_sparrow_full
from analysis.models.specular.unified import moving_sensor
from analysis.report.style import short_number
from instrument.geometry import FloatArray

_ALUMINIUM = 0.96 - 6.69j  # green light; E. D. Palik, Handbook of Optical Constants of Solids, 1985
_GLASS = 1.5
_NARROW = (0.01, 0.1, 0.5, 1.0, 2.0, 3.0)  # degrees, Fig. 13
_WIDE = (5.0, 7.0, 9.0, 13.0, 15.0, 17.0)  # degrees, Fig. 14
_SAME_ROUGHNESS = 13.0  # degrees, Fig. 14 (d)


def lobe(sigma_deg: float, theta_i: float, theta_r: FloatArray) -> FloatArray:
    """Radiance (54) over kappa_spec at view angles (N,) in degrees, + on the mirror side."""
    return moving_sensor(towards_mirror(theta_i, theta_r), 0.0, 1.0, sigma_deg, 0.0, 1.0)


def figure_11() -> PaperFigure:
    """Fresnel reflectance of a metal."""
    degrees = np.linspace(0.0, 90.0, 361)
    para, perp = reflectances(np.radians(degrees), _ALUMINIUM)
    mean = unpolarised(np.radians(degrees), _ALUMINIUM)
    lines = (
        Line(degrees, mean, "unpolarised", 0),
        Line(degrees, perp, "perpendicular", 1),
        Line(degrees, para, "parallel", 2),
    )
    return PaperFigure(
        number="11",
        title="Fresnel reflectance of a metal",
        caption=(
            "Energy reflectance of a flat interface, equations (12), (13) and (41), here of "
            "aluminium in green light (index 0.96 − 6.69i); the paper names no metal."
        ),
        panels=(
            chart("", lines, Axis("local incidence θ′ (°)", (0.0, 90.0)), Axis("F′", (0.0, 1.02))),
        ),
        checks=(_constant(_ALUMINIUM, "metals"), _constant(_GLASS, "dielectrics (here n = 1.5)")),
    )


def _constant(index: complex, kind: str) -> Check:
    first, last = unpolarised(np.radians([0.0, 75.0]), index)
    change = float(abs(last / first - 1))
    return Check(
        f"for {kind}, F′ is nearly constant up to a local incidence of about 75°",
        f"{first:.3f} at 0° and {last:.3f} at 75°",
        change < 0.05,
        ""
        if change < 0.05
        else "A dielectric’s reflectance has grown many times by then; the assumption that F′ is "
        "constant holds for metals only.",
    )


def figure_12() -> PaperFigure:
    """Geometric attenuation factor against the view angle."""
    x = np.linspace(-90.0, 90.0, 721)
    incidences = (0.0, 30.0, 45.0, 60.0, 75.0)
    lines = [
        Line(x, attenuation(towards_mirror(t, x)), f"θᵢ {t:g}°", k)
        for k, t in enumerate(incidences)
    ]
    return PaperFigure(
        number="12",
        title="Masking and shadowing of V-grooves",
        caption=(
            "The factor G of equation (44) in the plane of incidence. The text states no "
            "incidences."
        ),
        panels=(chart("", lines, Axis(MIRROR_SIDE, (-90.0, 90.0)), Axis("G", (0.0, 1.03))),),
        checks=(_unity_range(), *_vanishing(), _maximum_within()),
    )


def _unity_range() -> Check:
    """From (44), in the plane: G = 1 from max(-60 + t/3, 3 t - 180) to 60 + t/3 degrees."""
    x = np.linspace(-90.0, 90.0, 180_001)
    worst, widths = 0.0, []
    for t in (0.0, 30.0, 45.0, 60.0, 75.0):
        whole = x[attenuation(towards_mirror(t, x)) >= 1 - 1e-9]
        low, high = max(t / 3 - 60, 3 * t - 180), min(60 + t / 3, 90)
        worst = max(worst, abs(whole[0] - low), abs(whole[-1] - high))
        widths.append(high - low)
    return Check(
        "away from grazing incidence, G is 1 over a wide range of view angles",
        f"over {widths[0]:.0f}°, {widths[1]:.0f}°, {widths[3]:.0f}° and {widths[4]:.0f}° of view "
        f"at incidences 0°, 30°, 60° and 75°; its ends are those of (44) to 0.01°",
        worst < 0.01 and min(widths[:4]) >= 79,
    )


def _vanishing() -> tuple[Check, Check]:
    x = np.array([89.0, 89.9])
    largest = max(float(np.max(attenuation(towards_mirror(t, x))[1])) for t in (0.0, 45.0, 75.0))
    radiance = _attenuated(60.0, np.array([80.0, 89.0, 89.9]))
    vanishes = bool(radiance[-1] < 0.1 * radiance[0])
    return (
        Check("G approaches 0 at grazing view", f"at most {largest:.2g} at 89.9°", largest < 0.05),
        Check(
            "and faster than 1/cos θ<sub>r</sub> grows, so that the radiance vanishes there",
            "G/cos θ<sub>r</sub> times the lobe of 17° at incidence 60°: "
            + ", ".join(short_number(float(v), 3) for v in radiance)
            + " at 80°, 89° and 89.9°",
            vanishes,
            ""
            if vanishes
            else "By (44), G falls just as fast as 1/cos θ<sub>r</sub> grows: the radiance stays "
            "finite, but does not vanish.",
        ),
    )


def _attenuated(theta_i: float, theta_r: FloatArray) -> FloatArray:
    """Radiance with G, of facets with slopes of 17 degrees, over the irradiance across the beam."""
    at = towards_mirror(theta_i, theta_r)
    return np.asarray(np.cos(at.theta_i) * torrance_sparrow_full(at, 1.0, 17.0))


def _maximum_within() -> Check:
    least = 1.0
    for sigma in _NARROW:
        for theta_i in INCIDENCES:
            x = around(theta_i, sigma, 85.0)
            peak = x[int(np.argmax(lobe(sigma, theta_i, x)))]
            least = min(least, float(attenuation(towards_mirror(theta_i, peak))))
    return Check(
        "the radiance has its maximum where G is 1, which is why the diagrams take G = 1",
        f"least G at the peaks of Fig. 13: {least:.3f}",
        least > 1 - 1e-9,
    )


def _diagram(letter: str, sigma: float, *, physical: bool = False) -> Panel:
    lines = []
    for k, theta_i in enumerate(INCIDENCES):
        x = around(theta_i, 2 * sigma, 88.0)
        lines.append(Line(x, lobe(sigma, theta_i, x), f"θᵢ {theta_i:g}°", k))
        if physical:
            name = "(53)" if theta_i == INCIDENCES[-1] else ""
            lines.append(Line(x, _physical(sigma, theta_i, x), name, 4, thin=True))
    return chart(
        f"({letter}) σ<sub>α</sub> = {sigma:g}°",
        lines,
        Axis(MIRROR_SIDE, (-20.0 if sigma < 4 else -60.0, 90.0)),
        Axis("radiance (relative)", (0.0, 2.6 if sigma < 4 else 4.0)),
    )


def _physical(sigma: float, theta_i: float, theta_r: FloatArray) -> FloatArray:
    """Radiance (53) of the surface that (60) makes equivalent, on the same scale at the mirror."""
    at = towards_mirror(theta_i, theta_r)
    length = 10.0 / height_over_length(sigma)
    scale = 4 * np.pi * (2 * height_over_length(sigma)) ** 2  # 1 at theta_i = theta_r = 0
    return np.asarray(scale * np.cos(at.theta_i) * rough_lobe_brdf(at, 1.0, 10.0, length))


def figure_13() -> PaperFigure:
    """Narrow lobes of Torrance and Sparrow."""
    return PaperFigure(
        number="13",
        title="Lobes of Torrance and Sparrow’s model, smooth surfaces",
        caption=(
            "Equation (54) with a constant κ<sub>spec</sub> (no attenuation, constant Fresnel "
            "factor), 1 at normal incidence. The text states no incidences. A lobe of 0.01° is "
            "narrower than any lens; the formula holds for it all the same."
        ),
        panels=tuple(_diagram(letter, s) for letter, s in zip("abcdef", _NARROW, strict=True)),
        checks=(_growing_peaks(), _widths(), _symmetry()),
    )


def _growing_peaks() -> Check:
    ratios = []
    for sigma in _NARROW:
        x0, x60 = around(0.0, sigma, 88.0), around(60.0, sigma, 85.0)
        ratios.append(float(np.max(lobe(sigma, 60.0, x60)) / np.max(lobe(sigma, 0.0, x0))))
    return Check(
        "at each roughness the peak grows with the incidence, by 1/cos θ<sub>r</sub>",
        f"peak at 60° over that at 0°: {ratios[0]:.4f} (0.01°) to {ratios[-1]:.4f} (3°); "
        "1/cos 60° = 2",
        all(abs(r - 2) < 0.05 for r in ratios) and abs(ratios[0] - 2) < 1e-6,
    )


def _widths() -> Check:
    widths = []
    for sigma in _NARROW:
        x = 30.0 + sigma * np.linspace(-10, 10, 4001)
        widths.append(half_width(x, lobe(sigma, 30.0, x)) / (4 * np.sqrt(2 * np.log(2)) * sigma))
    return Check(
        "the width of the lobe increases with σ<sub>α</sub>",
        "full width at half maximum over that of exp(−α²/2σ<sub>α</sub>²) with 2α = "
        "θ<sub>r</sub> − θ<sub>i</sub>: " + ", ".join(f"{w:.4f}" for w in widths),
        all(abs(w - 1) < 0.01 for w in widths),
    )


def _symmetry() -> Check:
    off = np.linspace(0.01, 3.0, 100)
    worst = 0.0
    for sigma in _NARROW[:4]:
        up, down = (lobe(sigma, 30.0, 30.0 + sign * sigma * off) for sign in (1.0, -1.0))
        worst = max(worst, float(np.max(np.abs(up - down)) * np.cos(np.radians(30.0))))
    return Check(
        "for small σ<sub>α</sub> the lobe is a Gaussian, symmetric about the mirror direction",
        f"the two sides differ by up to {100 * worst:.1f} % of the peak at σ<sub>α</sub> = 1°, "
        "θ<sub>i</sub> = 30°",
        worst < 0.03,
    )


def figure_14() -> PaperFigure:
    """Wide lobes of Torrance and Sparrow, one beside that of physical optics."""
    panels = [
        _diagram(letter, s, physical=s == _SAME_ROUGHNESS)
        for letter, s in zip("abcdef", _WIDE, strict=True)
    ]
    return PaperFigure(
        number="14",
        title="Lobes of Torrance and Sparrow’s model, rough surfaces",
        caption=(
            "As Figure 13, equation (54). In (d), thin: the lobe of Beckmann and Spizzichino for "
            "rough surfaces, equation (53), of the surface that equation (60) makes equivalent."
        ),
        panels=tuple(panels),
        checks=(_beyond_the_mirror(), _resemblance(), _infinite()),
    )


def _beyond_the_mirror() -> Check:
    x = np.linspace(0.0, 80.0, 4001)
    beyond = [peak_at(x, lobe(s, 40.0, x)) - 40.0 for s in (1.0, *_WIDE[:3])]
    return Check(
        "for larger σ<sub>α</sub> the peak lies beyond the mirror direction",
        "at θ<sub>i</sub> = 40° by "
        + ", ".join(f"{b:.1f}° ({s:g}°)" for b, s in zip(beyond, (1.0, *_WIDE[:3]), strict=True)),
        rises(np.array(beyond)) and beyond[1] > 1,
    )


def _resemblance() -> Check:
    x = np.linspace(-60.0, 60.0, 601)
    worst = []
    for theta_i in INCIDENCES[:3]:
        one, other = lobe(13.0, theta_i, x), _physical(13.0, theta_i, x)
        worst.append(float(np.max(np.abs(one - other)) / np.max(one)))
    return Check(
        "(d) the two models resemble each other remarkably",
        "up to 60° they differ by "
        + ", ".join(f"{100 * w:.0f} %" for w in worst)
        + " of the peak at incidences 0°, 20° and 40°",
        max(worst) < 0.2,
    )


def _infinite() -> Check:
    values = lobe(17.0, 60.0, np.array([89.0, 89.9, 89.99]))
    return Check(
        "at oblique incidence the radiance approaches infinity near grazing view",
        f"17° at incidence 60°: from 89.9° to 89.99° by a factor of {values[2] / values[1]:.1f}",
        bool(values[2] / values[1] > 9),
    )
