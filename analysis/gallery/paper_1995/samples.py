"""Figures 16 to 22 of the 1995 paper: the curves beside measurements of six samples."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from analysis.gallery.curves import kink_at, peak_at, rises
from analysis.gallery.figure import Check, PaperFigure
from analysis.gallery.panels import VIEW, Axis, Line, chart
from analysis.gallery.paper_1995.gaussian_slopes import EXACT, radiance
from analysis.models import MODELS
from instrument.geometry import Brdf, FloatArray

INCIDENCES = (30.0, 45.0, 60.0)
_THETA_R = np.linspace(-80.0, 80.0, 321)
_X = Axis(VIEW, (-90.0, 90.0))
_Y = Axis("L(θᵣ)/L(0)", (0.0, None))
_GLOSSY = MODELS["oren_nayar+torrance_sparrow"].brdf


def normalised(
    brdf: Brdf, theta_i: float, theta_r: FloatArray = _THETA_R, dphi: float = 0.0
) -> FloatArray:
    """Radiance over that along the normal, (N,), at signed view angles in degrees."""
    whole = radiance(brdf, theta_i, np.concatenate([theta_r, [0.0]]), dphi)
    return np.asarray(whole[:-1] / whole[-1])


def _lines(brdf: Brdf) -> list[Line]:
    return [Line(_THETA_R, normalised(brdf, t), f"θᵢ {t:g}°", k) for k, t in enumerate(INCIDENCES)]


def matt_figure(number: str, name: str, sigma_deg: float, albedo: float) -> PaperFigure:
    """Figure of a matt sample at three incidences, by the integral."""
    brdf = partial(EXACT, albedo=albedo, sigma_deg=sigma_deg)
    return PaperFigure(
        number=number,
        title=name,
        caption=(
            "Radiance over that along the normal in the plane of incidence, by the integral (31): "
            f"σ = {sigma_deg:g}°, albedo {albedo:g}. The measured points are left out."
        ),
        panels=(chart("", _lines(brdf), _X, _Y),),
        checks=(towards_the_lamp(brdf), _at_the_lamp(brdf), not_lambertian(brdf)),
    )


def towards_the_lamp(brdf: Brdf) -> Check:
    """Check of a BRDF, as `Model.brdf`: the radiance rises from the mirror side up to the lamp."""
    rising = []
    for t in INCIDENCES:
        x = np.linspace(-50.0, t, 200)
        rising.append(rises(normalised(brdf, t, x)))
    ends = [float(normalised(brdf, t, np.array([t]))[0]) for t in INCIDENCES]
    return Check(
        "the radiance increases as the view approaches the lamp",
        "from −50° on it never falls; towards the lamp it is "
        + ", ".join(f"{e:.2f}" for e in ends)
        + " of that along the normal at 30°, 45°, 60°",
        all(rising) and min(ends) > 1,
    )


def _at_the_lamp(brdf: Brdf) -> Check:
    kinks = []
    for t in INCIDENCES:
        x = np.linspace(t - 8, t + 8, 161)
        kinks.append(kink_at(x, normalised(brdf, t, x)))
    return Check(
        "the increase is cut off where the camera meets the lamp",
        "bends at " + ", ".join(f"{k:.1f}°" for k in kinks),
        all(abs(k - t) < 0.11 for k, t in zip(kinks, INCIDENCES, strict=True)),
    )


def not_lambertian(brdf: Brdf) -> Check:
    """Check of a BRDF, as `Model.brdf`: it is larger backward than forward."""
    ratio = [float(np.divide(*normalised(brdf, t, np.array([t, -t])))) for t in INCIDENCES]
    return Check(
        "unlike rough specular surfaces it reflects more backward than forward",
        "radiance at θ<sub>r</sub> = θ<sub>i</sub> over that in the mirror direction "
        + ", ".join(f"{r:.2f}" for r in ratio),
        min(ratio) > 1 and rises(np.array(ratio)),
    )


def figure_16() -> PaperFigure:
    """Sample A."""
    return matt_figure("16", "Wall plaster (sample A)", 30.0, 0.90)


def figure_17() -> PaperFigure:
    """Sample B."""
    return matt_figure("17", "Painted sandpaper (sample B)", 40.0, 0.80)


def figure_18() -> PaperFigure:
    """Sample C."""
    return matt_figure("18", "White sand (sample C; B in 1994)", 35.0, 0.80)


def figure_19() -> PaperFigure:
    """Sample C outside the plane of incidence."""
    brdf = partial(EXACT, albedo=0.80, sigma_deg=35.0)
    cases = ((60.0, 45.0), (75.0, 60.0))
    panels = []
    for letter, (theta_i, dphi) in zip("ab", cases, strict=True):
        lines = (
            Line(_THETA_R, normalised(brdf, theta_i, dphi=dphi), f"Δφ {dphi:g}°", 0),
            Line(_THETA_R, normalised(brdf, theta_i), "plane of incidence", 4, thin=True),
        )
        title = f"({letter}) θ<sub>i</sub> = {theta_i:g}°, φ<sub>r</sub> = {dphi:g}°"
        panels.append(chart(title, lines, _X, _Y))
    ends = [
        (normalised(brdf, t, np.array([t]), d)[0], normalised(brdf, t, np.array([t]))[0])
        for t, d in cases
    ]
    x = np.linspace(0.0, 55.0, 56)
    rising = all(rises(normalised(brdf, t, x, d)) for t, d in cases)
    return PaperFigure(
        number="19",
        title="White sand (sample C) outside the plane of incidence",
        caption=(
            "As Figure 18, by the integral (31), for views out of the plane of incidence; thin: in "
            "it, for comparison. The measured points are left out."
        ),
        panels=tuple(panels),
        checks=(
            Check(
                "on the lamp’s side the radiance still increases with the view angle, but less "
                "than in the plane of incidence",
                "; ".join(
                    f"{out:.2f} in place of {within:.2f} at θ<sub>r</sub> = {t:g}°"
                    for (out, within), (t, _) in zip(ends, cases, strict=True)
                ),
                rising and all(1 < out < within for out, within in ends),
            ),
        ),
    )


def glossy_figure(
    number: str, name: str, sigma_deg: float, albedo: float, ratio: float
) -> PaperFigure:
    """Figure of a sample with a specular lobe: functional form and Torrance and Sparrow's."""
    # The paper's lobe (37) leaves out the factor 1/4 that the project's has.
    glossy = partial(_GLOSSY, albedo=albedo, sigma_deg=sigma_deg, ks=4 * ratio)
    matt = partial(MODELS["oren_nayar"].brdf, albedo=albedo, sigma_deg=sigma_deg)
    lines = [*_lines(glossy), Line(_THETA_R, normalised(matt, 60.0), "60°, no lobe", 4, thin=True)]
    return PaperFigure(
        number=number,
        title=name,
        caption=(
            "Radiance over that along the normal, by (38): functional form (33) + (34) and the "
            f"lobe (37) with F = 1; σ = {sigma_deg:g}°, albedo {albedo:g}, k<sub>s</sub>/k"
            f"<sub>d</sub> = {ratio:g}. The measured points are left out."
        ),
        panels=(chart("", lines, _X, _Y),),
        checks=(_forward(glossy, matt), _cut_off(glossy)),
    )


def _forward(glossy: Brdf, matt: Brdf) -> Check:
    x = np.array([-60.0])
    gain = [float(radiance(glossy, t, x)[0] / radiance(matt, t, x)[0]) for t in INCIDENCES]
    return Check(
        "the lobe raises the radiance in the forward direction",
        "at −60° by factors of " + ", ".join(f"{g:.2f}" for g in gain) + " at 30°, 45°, 60°",
        min(gain) > 1 and rises(np.array(gain)),
    )


def _cut_off(glossy: Brdf) -> Check:
    """Right of the lamp the slope of the radiance is lower than left of it: a kink."""
    drops = []
    for t in INCIDENCES:
        left, at, right = normalised(glossy, t, np.array([t - 1.0, t, t + 1.0]))
        drops.append((at - left) - (right - at))
    return Check(
        "the model describes the increase towards the lamp and the cut-off at the lamp’s direction",
        "the slope falls there by " + ", ".join(f"{d:.4f}" for d in drops) + " per degree",
        min(drops) > 0,
    )


def _wide_lobe() -> Check:
    x = np.linspace(-89.0, 85.0, 1741)
    lobes = [
        radiance(partial(MODELS["torrance_sparrow"].brdf, ks=1.0, sigma_deg=s), 45.0, x)
        for s in (2.0, 5.0, 10.0)
    ]
    peaks = [peak_at(x, y) for y in lobes]
    above = [float(np.mean(y > np.max(y) / 2)) * 174 for y in lobes]
    return Check(
        "the lobe (37) has its peak close to the mirror direction and widens with σ",
        "at incidence 45° the lobe alone has its peak at "
        + ", ".join(f"{p:.0f}°" for p in peaks).replace("-", "−")
        + " and is above half of it over "
        + ", ".join(f"{a:.0f}°" for a in above)
        + ", for σ = 2°, 5°, 10°",
        rises(np.array(above)) and abs(peaks[1] + 45) < 5,
        "A lobe as wide as this sample’s has its peak far beyond the mirror direction.",
    )


def figure_20() -> PaperFigure:
    """Sample D."""
    figure = glossy_figure("20", "Foam (sample D)", 20.0, 0.80, 0.019)
    return replace(figure, checks=(*figure.checks, _wide_lobe()))


def figure_21() -> PaperFigure:
    """Sample E."""
    return glossy_figure("21", "Cotton towel (sample E)", 42.0, 0.75, 0.085)


def figure_22() -> PaperFigure:
    """Sample F."""
    return glossy_figure("22", "Wood shavings (sample F)", 26.0, 0.70, 0.043)
