"""Figures 10 to 14 of the 1995 paper: the model of Gaussian slopes and its two short forms."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.curves import kink_at, rises, spread, straightness
from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import VIEW, Axis, Line, chart
from analysis.models import MODELS
from analysis.models.rough.oren_nayar_forms import oren_nayar_qualitative_brdf
from analysis.report.style import short_number
from instrument.geometry import Brdf, FloatArray, Geometry

ALBEDO = 0.9
THETA_R = np.linspace(-89.0, 89.0, 357)
_X = Axis(VIEW, (-90.0, 90.0))
_LAMP = 75.0  # degrees, of Figs. 10, 11 and 14
_FOOTNOTE_11 = 0.57  # in place of 0.33 in A of (36)

EXACT, FUNCTIONAL = (MODELS[name].brdf for name in ("oren_nayar_exact", "oren_nayar"))
QUALITATIVE = MODELS["oren_nayar_qualitative"].brdf


def radiance(
    brdf: Brdf, theta_i: float, theta_r: FloatArray = THETA_R, dphi: float = 0.0
) -> FloatArray:
    """Radiance over E_0 in 1/sr at signed view angles (N,), + on the lamp's side, in degrees."""
    at = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    return np.asarray(brdf(at) * np.cos(np.radians(theta_i)))


def exact(sigma_deg: float, albedo: float = ALBEDO) -> Brdf:
    """BRDF by the integral (31), of shape and unit as `Model.brdf`."""
    return partial(EXACT, albedo=albedo, sigma_deg=sigma_deg)


def direct(
    sigma_deg: float, theta_i: float, theta_r: FloatArray = THETA_R, albedo: float = ALBEDO
) -> FloatArray:
    """Radiance over E_0 in 1/sr, (N,), of light of one bounce: that of a vanishing albedo."""
    return radiance(exact(sigma_deg, 1e-12), theta_i, theta_r) * (albedo / 1e-12)


def figure_10() -> PaperFigure:
    """Radiance in the plane of incidence with and without interreflection."""
    lines = (
        Line(THETA_R, radiance(exact(30.0), _LAMP), "with interreflection", 0),
        Line(THETA_R, direct(30.0, _LAMP), "direct light alone", 1, thin=True),
    )
    return PaperFigure(
        number="10",
        title="Reflection in the plane of incidence, with and without interreflection",
        caption=(
            "Radiance by the integral (31) over Gaussian slopes of σ = 30°, with exact shadowing, "
            "masking (15) and two bounces (26); albedo 0.9, incidence 75°."
        ),
        panels=(chart("", lines, _X, Axis("L/E₀ (1/sr)", (0.0, None)), ((75.0, "θᵢ"),)),),
        checks=three_sections(),
    )


def three_sections() -> tuple[Check, ...]:
    """Checks of the three sections of the curve."""
    near = np.linspace(60.0, 88.0, 281)
    curves = [radiance(exact(s), _LAMP, near) for s in (10.0, 20.0, 30.0, 45.0, 60.0)]
    kinks = [kink_at(near, y) for y in curves]
    before, after = (float(np.gradient(curves[2], near)[k]) for k in (147, 153))
    middle = np.linspace(-20.0, 74.0, 95)
    r2 = straightness(np.tan(np.radians(middle)), radiance(exact(30.0), _LAMP, middle))
    far = np.array([-85.0, -75.0, -60.0, 0.0])
    once = direct(30.0, _LAMP, far)
    ratio = radiance(exact(30.0), _LAMP, far) / once - 1
    off = max(abs(k - _LAMP) for k in kinks)
    return (
        Check(
            "the increase towards the lamp is cut off exactly at θ<sub>r</sub> = θ<sub>i</sub>, at "
            "any roughness",
            f"bend at {kinks[0]:.1f}°, {kinks[2]:.1f}° and {kinks[4]:.1f}° for σ = 10°, 30° and "
            "60° with θ<sub>i</sub> = 75°; beyond it the slope, for 30°, is "
            f"{after / before:.2f} of that before",
            off < 0.11 and after < 0.2 * before,
        ),
        Check(
            "in the middle it varies about as a + b tan θ<sub>r</sub>",
            f"R² {r2:.4f} of that line from −20° to 74°",
            r2 > 0.99,
        ),
        Check(
            "far forward, interreflection dominates",
            "interreflection over direct light "
            + ", ".join(short_number(float(r), 3) for r in ratio)
            + " at −85°, −75°, −60° and 0°",
            bool(ratio[0] > 1 and rises(-ratio)),
            "It exceeds direct light only next to grazing; over the rest of the forward directions "
            "the two are comparable.",
        ),
    )


def figure_11() -> PaperFigure:
    """Radiance for several roughnesses."""
    sigmas = (0.0, 10.0, 20.0, 30.0, 40.0)
    curves = [radiance(exact(s), _LAMP) for s in sigmas]
    lines = [
        Line(THETA_R, y, f"σ {s:g}°", k)
        for k, (s, y) in enumerate(zip(sigmas, curves, strict=True))
    ]
    flat = ALBEDO / np.pi * np.cos(np.radians(_LAMP))
    lambertian = float(np.max(np.abs(curves[0] / flat - 1)))
    rms = [float(np.sqrt(np.mean((y / flat - 1) ** 2))) for y in curves]
    return PaperFigure(
        number="11",
        title="Effect of the roughness",
        caption=(
            "As Figure 10, by the integral (31), for several roughnesses; of these the text states "
            "σ = 0 only."
        ),
        panels=(chart("", lines, _X, Axis("L/E₀ (1/sr)", (0.0, None))),),
        checks=(
            Check(
                "at σ = 0 the model is exactly Lambert’s",
                f"differs by {short_number(lambertian, 1)}",
                lambertian < 1e-12,
            ),
            Check(
                "the deviation from Lambert’s law increases with the roughness",
                "rms deviation "
                + ", ".join(f"{100 * r:.0f} %" for r in rms)
                + " at "
                + ", ".join(f"{s:g}°" for s in sigmas),
                rises(np.array(rms)),
            ),
        ),
    )


_INCIDENCES = (0.0, 30.0, 45.0, 60.0, 75.0)
_AZIMUTHS = (0.0, 30.0, 60.0, 90.0)


def _brdf(theta_i: float, theta_r: FloatArray = THETA_R, dphi: float = 0.0) -> FloatArray:
    """BRDF in 1/sr, (N,), of the surface of Fig. 12."""
    return np.asarray(radiance(exact(40.0), theta_i, theta_r, dphi) / np.cos(np.radians(theta_i)))


def figure_12() -> PaperFigure:
    """BRDF for several incidences, and outside the plane of incidence."""
    y = Axis("BRDF (1/sr)", (0.0, 1.0))
    by_incidence = [Line(THETA_R, _brdf(t), f"θᵢ {t:g}°", k) for k, t in enumerate(_INCIDENCES)]
    by_azimuth = [
        Line(THETA_R, _brdf(_LAMP, dphi=d), f"Δφ {d:g}°", k) for k, d in enumerate(_AZIMUTHS)
    ]
    return PaperFigure(
        number="12",
        title="BRDF at several incidences, and outside the plane of incidence",
        caption=(
            "By the integral (31), σ = 40°, albedo 0.9. (b) is at incidence 75°; the text states "
            "neither the incidences of (a) nor that of (b) nor its azimuths. Δφ turns the plane in "
            "which the camera moves."
        ),
        panels=(
            chart("(a) in the plane of incidence", by_incidence, _X, y),
            chart("(b) in other planes", by_azimuth, _X, y),
        ),
        checks=near_lambertian(),
    )


def near_lambertian() -> tuple[Check, Check, Check]:
    """Checks of Fig. 12, also that of the 1994 paper's figure 6."""
    x = np.linspace(-60.0, 60.0, 121)
    varies = [spread(_brdf(t, x)) for t in _INCIDENCES]
    back = [float(_brdf(t, np.array([t]))[0] / _brdf(t, np.zeros(1))[0]) for t in _INCIDENCES]
    across, along = spread(_brdf(_LAMP, x, 90.0)), spread(_brdf(_LAMP, x))
    return (
        Check(
            "near normal incidence the BRDF is nearly Lambert’s",
            f"varies by {100 * varies[0]:.0f} % between −60° and 60° at incidence 0°, by "
            f"{100 * varies[3]:.0f} % at 60°",
            varies[0] < 0.1 < varies[1],
        ),
        Check(
            "as the incidence grows, backscatter begins to dominate",
            "BRDF towards the lamp over that along the normal "
            + ", ".join(f"{b:.2f}" for b in back)
            + " at "
            + ", ".join(f"{t:g}°" for t in _INCIDENCES),
            rises(np.array(back)),
        ),
        Check(
            "perpendicular to the plane of incidence the surface is nearly Lambertian again",
            f"varies by {100 * across:.0f} % between −60° and 60°, in the plane of incidence by "
            f"{100 * along:.0f} %",
            across < 0.15 * along,
        ),
    )


_COMPARED = (30.0, 45.0, 60.0, 75.0)


def figure_13() -> PaperFigure:
    """Integral and functional form."""
    functional = partial(FUNCTIONAL, albedo=ALBEDO, sigma_deg=30.0)
    lines = []
    for k, t in enumerate(_COMPARED):
        lines.append(Line(THETA_R, radiance(exact(30.0), t), f"θᵢ {t:g}°", k))
        form = radiance(functional, t)
        lines.append(Line(THETA_R, form, "(33) + (34)" if t == _COMPARED[-1] else "", 4, thin=True))
    return PaperFigure(
        number="13",
        title="The integral and its functional form",
        caption=(
            "Coloured: integral (31) with interreflection; thin: (33) + (34). σ = 30°, albedo 0.9, "
            "plane of incidence. The text states no incidences."
        ),
        panels=(chart("", lines, _X, Axis("L/E₀ (1/sr)", (0.0, None))),),
        checks=_accuracy(functional),
    )


def _accuracy(functional: Brdf) -> tuple[Check, Check]:
    x = np.linspace(-80.0, 80.0, 161)
    off = []
    for t in _COMPARED:
        found, form = radiance(exact(30.0), t, x), radiance(functional, t, x)
        off.append(float(np.max(np.abs(form - found)) / np.max(found)))
    at = Geometry.from_degrees(theta_i=75.0, theta_r=60.0, dphi=0.0)
    twice = [
        float(brdf(at, albedo=1.0, sigma_deg=30.0) - 1e9 * brdf(at, albedo=1e-9, sigma_deg=30.0))
        * np.pi
        for brdf in (FUNCTIONAL, EXACT)
    ]
    return (
        Check(
            "in all cases the functional form is very accurate",
            "differs by up to "
            + ", ".join(f"{100 * o:.1f} %" for o in off)
            + " of the largest radiance at incidences "
            + ", ".join(f"{t:g}°" for t in _COMPARED),
            max(off) < 0.08,
        ),
        Check(
            "also interreflection (34), which was fitted in the same way",
            f"θ<sub>i</sub> 75°, θ<sub>r</sub> 60° on the lamp’s side: {twice[0]:.4f} by (34), "
            f"{twice[1]:.4f} by (26), over ρ²/π",
            abs(twice[0] / twice[1] - 1) < 0.25,
            "At oblique angles (34) is up to twice the integral; it is a small part of the whole.",
        ),
    )


def figure_14() -> PaperFigure:
    """Integral and qualitative form."""
    qualitative = partial(QUALITATIVE, albedo=ALBEDO, sigma_deg=30.0)
    return PaperFigure(
        number="14",
        title="The integral and the qualitative form",
        caption=(
            "Thick: integral (31) with interreflection; thin: (36), also with the constant 0.57 of "
            "footnote 11. σ = 30°, albedo 0.9, incidence 75°; the text does not state the azimuth "
            "of (b)."
        ),
        panels=(
            _qualitative_panel("(a) in the plane of incidence", qualitative, 0.0),
            _qualitative_panel("(b) outside, Δφ = 60°", qualitative, 60.0),
        ),
        checks=_qualitative_checks(qualitative),
    )


def _with_footnote(geometry: Geometry) -> FloatArray:
    return oren_nayar_qualitative_brdf(geometry, ALBEDO, 30.0, _FOOTNOTE_11)


def _qualitative_panel(title: str, qualitative: Brdf, dphi: float) -> Panel:
    lines = (
        Line(THETA_R, radiance(exact(30.0), _LAMP, THETA_R, dphi), "integral", 0),
        Line(THETA_R, radiance(qualitative, _LAMP, THETA_R, dphi), "(36)", 1, thin=True),
        Line(THETA_R, radiance(_with_footnote, _LAMP, THETA_R, dphi), "with 0.57", 2, thin=True),
    )
    return chart(title, lines, _X, Axis("L/E₀ (1/sr)", (0.0, 0.22)))


def _qualitative_checks(qualitative: Brdf) -> tuple[Check, Check, Check]:
    flat = radiance(partial(QUALITATIVE, albedo=ALBEDO, sigma_deg=0.0), _LAMP)
    off = spread(flat) + abs(float(flat[0]) * np.pi / ALBEDO / np.cos(np.radians(_LAMP)) - 1)
    # Interreflection counts where light is direct, too: compared where (36) means to describe it.
    x = np.linspace(0.0, 74.0, 75)
    whole = radiance(exact(30.0), _LAMP, x)
    printed, mended = (
        float(np.max(np.abs(radiance(f, _LAMP, x) / whole - 1)))
        for f in (qualitative, _with_footnote)
    )
    forward = np.array([-60.0])
    ratio = float(
        (radiance(qualitative, _LAMP, forward) / radiance(exact(30.0), _LAMP, forward))[0]
    )
    return (
        Check(
            "the qualitative form is Lambert’s law at σ = 0",
            f"differs by {short_number(off, 1)}",
            off < 1e-12,
        ),
        Check(
            "0.57 in place of 0.33 partly makes up for the missing interreflection (footnote 11)",
            f"on the lamp’s side it differs by up to {100 * mended:.0f} % in place of "
            f"{100 * printed:.0f} %",
            mended < printed,
        ),
        Check(
            "it is reasonably accurate, for rendering",
            f"within {100 * printed:.0f} % on the lamp’s side; at −60° {ratio:.2f} times the "
            "integral",
            ratio < 1.3,
            "Forward it leaves out the negative C₂ of (33) and can be twice the integral.",
        ),
    )
