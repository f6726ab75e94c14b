"""Figures 9 and 10 of the 1991 paper: spike and lobe of Beckmann and Spizzichino."""

from __future__ import annotations

import numpy as np

from analysis.gallery.curves import around, half_width, peak_at, rises, spread, towards_mirror
from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import MIRROR_SIDE, Axis, Line, chart
from analysis.models.specular.beckmann_spizzichino import lobe_brdf, optical_roughness, spike_brdf
from analysis.models.specular.scattered_power import (
    Surface,
    general_radiance,
    patch_of_pixel,
    rough_radiance,
)
from analysis.report.style import short_number
from instrument.geometry import FloatArray

INCIDENCES = (0.0, 20.0, 40.0, 60.0)  # the text states none
_PIXEL = 50.0  # wavelengths: side of the area that a pixel images at normal view
_HEIGHTS = (0.002, 0.05, 0.1, 0.33, 0.5)  # sigma_h / lambda of Fig. 9
_GENTLE = 0.02  # sigma_h / T of Fig. 9: the text states none
_SLOPES = (0.01, 0.02, 0.066, 0.1, 0.2)  # sigma_h / T of Fig. 10
_ROUGH = 1.5  # sigma_h / lambda of Fig. 10: no spike is left


def spike_and_lobe(
    sigma_h: float, theta_i: float, theta_r: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Radiance (N,) of the spike and of the lobe, relative to a mirror in the mirror direction.

    At view angles (N,) in degrees, + on the mirror side; `sigma_h` in wavelengths.
    """
    at = towards_mirror(theta_i, theta_r)
    patch = patch_of_pixel(_PIXEL, 1.0, 0.0, at.theta_r)
    lamp = np.cos(at.theta_i) / _PIXEL**2
    spike = lamp * spike_brdf(at, 1.0, sigma_h, patch.X, patch.Y)
    return spike, lamp * lobe_brdf(at, 1.0, sigma_h, sigma_h / _GENTLE)


def _diagram(letter: str, sigma_h: float) -> Panel:
    lines = []
    for k, theta_i in enumerate(INCIDENCES):
        theta_r = around(theta_i, 0.5, 88.0)
        at = towards_mirror(theta_i, theta_r)
        patch = patch_of_pixel(_PIXEL, 1.0, 0.0, at.theta_r)
        surface = Surface(sigma_h, sigma_h / _GENTLE)
        radiance = general_radiance(at, surface, patch) / _PIXEL**2
        lines.append(Line(theta_r, radiance, f"θᵢ {theta_i:g}°", k))
    top = 1.05 * max(float(np.max(line.y[line.x < 80])) for line in lines)
    return chart(
        f"({letter}) σ<sub>h</sub>/λ = {sigma_h:g}",
        lines,
        Axis(MIRROR_SIDE, (-20.0, 90.0)),
        Axis("radiance, mirror = 1", (0.0, top)),
    )


def _close_up() -> Panel:
    x = np.linspace(37.0, 43.0, 601)
    line = Line(x, spike_and_lobe(_HEIGHTS[0], 40.0, x)[0], "θᵢ 40°", 2)
    return chart("(b) one spike of (a), rescaled", [line], Axis(MIRROR_SIDE), Axis("radiance"))


def figure_9() -> PaperFigure:
    """Radiance for five ratios of height to wavelength."""
    panels = [_diagram(letter, s) for letter, s in zip("acdef", _HEIGHTS, strict=True)]
    return PaperFigure(
        number="9",
        title="Radiance of Beckmann and Spizzichino’s model from smooth to rough",
        caption=(
            "Spike and lobe, equation (52) with (19)–(22) and (73), for five roughnesses; in the "
            "unit of a perfect mirror’s image of the lamp. The text states neither the incidences "
            f"nor σ<sub>h</sub>/T nor the pixel: here σ<sub>h</sub>/T = {_GENTLE:g}, and a pixel "
            f"that images {_PIXEL:g} wavelengths square at normal view. All terms of the sum that "
            "matter, instead of the first 100."
        ),
        panels=(panels[0], _close_up(), *panels[1:]),
        checks=(
            *_mirror_checks(),
            _fading_spike(),
            _leading_lobe(),
            _no_spike(),
            _mirror_like(),
        ),
    )


def _mirror_checks() -> tuple[Check, Check]:
    theta = np.array([0.0, 20.0, 40.0, 60.0, 75.0])
    peaks = np.array([float(spike_and_lobe(0.002, t, np.array([t]))[0][0]) for t in theta])
    # The square of a sinc: zero where v_x X = pi, with the patch elongated by 1/cos(theta_r).
    x = np.linspace(40.0, 43.0, 30001)
    y = spike_and_lobe(0.002, 40.0, x)[0]
    first_zero = float(x[np.flatnonzero((y[1:-1] < y[:-2]) & (y[1:-1] < y[2:]))[0] + 1])
    sine, tangent = np.sin(np.radians(first_zero)), np.cos(np.radians(first_zero))
    turns = float((sine - np.sin(np.radians(40.0))) * _PIXEL / tangent)
    return (
        Check(
            "σ<sub>h</sub>/λ = 0.002 is a mirror: the same radiance in the mirror direction at all "
            "incidences (section IV-A-1)",
            f"differs by {100 * spread(peaks):.2g} % between 0° and 75°",
            spread(peaks) < 1e-3,
        ),
        Check(
            "the spike is the square of a sinc (20): its first zero where v<sub>x</sub>X = π",
            f"at {first_zero:.2f}°, v<sub>x</sub>X = {turns:.4f} π",
            abs(turns - 1) < 1e-3,
        ),
    )


def _fading_spike() -> Check:
    found = {
        (s, t): float(spike_and_lobe(s, t, np.array([t]))[0][0])
        for s in (0.025, 0.05, 0.1)
        for t in (0.0, 75.0)
    }
    falls = found[0.025, 0.0] > 0.9 and found[0.1, 0.0] < 0.25
    return Check(
        "the spike falls rapidly once σ<sub>h</sub>/λ exceeds 0.025, but stays strong at large "
        "angles",
        "of a mirror’s, at 0°: "
        + ", ".join(f"{found[s, 0.0]:.2f} (σ<sub>h</sub>/λ = {s:g})" for s in (0.025, 0.05, 0.1))
        + f"; at 75°, 0.1: {found[0.1, 75.0]:.2f}",
        falls and found[0.1, 75.0] > 0.85,
    )


def _leading_lobe() -> Check:
    theta = np.array([0.0, 20.0, 40.0])
    ratios = []
    for sigma_h in (0.33, 0.5):
        parts = [spike_and_lobe(sigma_h, t, np.array([t])) for t in theta]
        ratios.append(max(float(spike[0] / lobe[0]) for spike, lobe in parts))
    return Check(
        "at σ<sub>h</sub>/λ = 0.33 and 0.5 the spike has faded and the lobe dominates",
        f"spike over lobe up to {short_number(ratios[0], 2)} and {short_number(ratios[1], 2)} for "
        "incidences up to 40°",
        ratios[0] < 0.1 and ratios[1] < 1e-3,
    )


def _no_spike() -> Check:
    spike, lobe = spike_and_lobe(1.5, 75.0, np.array([75.0]))
    ratio = float(spike[0] / lobe[0])
    return Check(
        "no spike is left above σ<sub>h</sub>/λ = 1.5 unless the incidence is near grazing",
        f"spike over lobe {short_number(ratio, 2)} at 75°",
        ratio < 1e-6,
    )


def _mirror_like() -> Check:
    share = float(np.exp(-optical_roughness(towards_mirror(0.0, 0.0), 0.025)))
    return Check(
        "a surface is like a mirror below σ<sub>h</sub>/λ = 0.025",
        f"there the spike still holds {100 * share:.0f} % of the light, e<sup>−g</sup>, at normal "
        "incidence and more beyond",
        share > 0.9,
    )


def _lobe(slope: float, theta_i: float, theta_r: FloatArray) -> FloatArray:
    at = towards_mirror(theta_i, theta_r)
    return np.asarray(np.cos(at.theta_i) * lobe_brdf(at, 1.0, _ROUGH, _ROUGH / slope))


def _lobe_rough(slope: float, theta_i: float, theta_r: FloatArray) -> FloatArray:
    return rough_radiance(towards_mirror(theta_i, theta_r), Surface(_ROUGH, _ROUGH / slope))


def _lobes(letter: str, slope: float) -> Panel:
    lines = []
    for k, theta_i in enumerate(INCIDENCES):
        theta_r = around(theta_i, 80 * slope, 88.0)
        lines.append(Line(theta_r, _lobe(slope, theta_i, theta_r), f"θᵢ {theta_i:g}°", k))
        if letter == "a":
            rough = _lobe_rough(slope, theta_i, theta_r)
            name = "(53)" if theta_i == INCIDENCES[-1] else ""
            lines.append(Line(theta_r, rough, name, 4, thin=True))
    top = 1.05 * max(float(np.max(line.y[line.x < 75])) for line in lines)
    return chart(
        f"({letter}) σ<sub>h</sub>/T = {slope:g}",
        lines,
        Axis(MIRROR_SIDE, (-60.0, 90.0)),
        Axis("radiance (relative)", (0.0, top)),
    )


def figure_10() -> PaperFigure:
    """Lobe for five ratios of height to correlation length."""
    return PaperFigure(
        number="10",
        title="The lobe of Beckmann and Spizzichino’s model for five slopes",
        caption=(
            "The lobe of equation (52) alone; in (a), thin, also its limit for rough surfaces "
            f"(53). σ<sub>h</sub>/λ = {_ROUGH:g}, where no spike is left; the text states neither "
            "that nor the incidences. The radiance is in units of the lamp’s; towards grazing it "
            "grows without limit, as printed (no shadowing)."
        ),
        panels=tuple(_lobes(letter, s) for letter, s in zip("abcde", _SLOPES, strict=True)),
        checks=(_rough_limit(), _sharp_lobe(), _wider_and_lower(), *_off_specular(), _grazing()),
    )


def _rough_limit() -> Check:
    worst = 0.0
    for theta_i in INCIDENCES:
        x = around(theta_i, 0.8, 75.0)
        exact, rough = _lobe(0.01, theta_i, x), _lobe_rough(0.01, theta_i, x)
        worst = max(worst, float(np.max(np.abs(rough - exact)) / np.max(exact)))
    return Check(
        "(a) the limit (53) approximates the lobe well",
        f"within {100 * worst:.2g} % of the peak up to 75°",
        worst < 0.02,
    )


def _sharp_lobe() -> Check:
    x = around(60.0, 0.8, 80.0, 2001)
    width = half_width(x, _lobe(0.01, 60.0, x))
    peaks = [float(np.max(_lobe(0.01, t, around(t, 0.8, 80.0)))) for t in (0.0, 60.0)]
    ratio = peaks[1] / peaks[0]
    return Check(
        "below σ<sub>h</sub>/T = 0.02 the lobe looks like a spike, but its peak grows with the "
        "incidence as 1/cos θ<sub>r</sub>",
        f"{width:.1f}° wide at 60° (σ<sub>h</sub>/T = 0.01); peak {ratio:.3f} times that at 0° "
        "(1/cos 60° = 2)",
        width < 6 and abs(ratio - 2) < 0.03,
    )


def _wider_and_lower() -> Check:
    x = [around(20.0, 80 * s, 75.0, 1501) for s in _SLOPES]
    y = [_lobe(s, 20.0, at) for s, at in zip(_SLOPES, x, strict=True)]
    widths = [half_width(a, b) for a, b in zip(x[:-1], y[:-1], strict=True)]
    peaks = [float(np.max(b)) for b in y]
    return Check(
        "the lobe widens and its peak falls as σ<sub>h</sub>/T increases",
        "at 20°, full widths at half maximum "
        + ", ".join(f"{w:.1f}°" for w in widths)
        + " and peaks "
        + ", ".join(short_number(p, 3) for p in peaks),
        rises(np.array(widths)) and rises(-np.array(peaks)),
    )


def _off_specular() -> tuple[Check, Check]:
    x = around(40.0, 1.0, 80.0, 3001)
    beyond = [peak_at(x, _lobe(s, 40.0, x)) - 40.0 for s in (0.02, 0.05, 0.066, 0.1)]
    narrow = _lobe(0.02, 40.0, x)
    gauss = np.max(narrow) * np.exp(-0.5 * ((x - 40.0) * 2.3548 / half_width(x, narrow)) ** 2)
    misfit = float(np.max(np.abs(narrow - gauss)) / np.max(narrow))
    return (
        Check(
            "below σ<sub>h</sub>/T = 0.05 a Gaussian about the mirror direction describes the lobe",
            f"peak {beyond[0]:.2f}° (0.02) and {beyond[1]:.2f}° (0.05) beyond 40°; at 0.02 a "
            f"Gaussian is {100 * misfit:.1f} % of the peak off",
            beyond[0] < 0.3 and beyond[1] < 1.5 and misfit < 0.06,
        ),
        Check(
            "for larger σ<sub>h</sub>/T the peak lies beyond the mirror direction",
            f"by {beyond[2]:.1f}° (0.066) and {beyond[3]:.1f}° (0.1) at 40°",
            beyond[3] > beyond[2] > beyond[1] > 0,
        ),
    )


def _grazing() -> Check:
    values = _lobe(0.2, 60.0, np.array([80.0, 89.0, 89.9, 89.99]))
    return Check(
        "the radiance approaches infinity as θ<sub>r</sub> approaches 90°",
        f"σ<sub>h</sub>/T = 0.2, θ<sub>i</sub> = 60°: from 89.9° to 89.99° it grows by a factor "
        f"of {values[3] / values[2]:.1f}",
        bool(np.all(np.diff(values) > 0)) and values[3] / values[2] > 9,
    )
