"""Section 4 of the 1998 paper, which has no figure: the combined model, and Lambert's law."""

from __future__ import annotations

from functools import partial

import numpy as np

from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import VIEW, Axis, Line, chart
from analysis.gallery.paper_1995.gaussian_slopes import EXACT, radiance
from analysis.gallery.paper_1998.plane import SMOOTH
from analysis.gallery.pictures import contours
from analysis.models import MODELS
from analysis.models.smooth.wolff_facets import wolff_facets_brdf
from instrument.geometry import Brdf, FloatArray, Geometry

_ALBEDO, _N = 0.9, 1.5
_INCIDENCES = (0.0, 30.0, 60.0)
_X = np.linspace(-85.0, 85.0, 69)
_SLIGHT, _TRANSITION = 9.0, 22.0  # degrees: where smooth models end, and amid the transition
_ERRORS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


def _combined(sigma_deg: float) -> Brdf:
    """BRDF of (3) with C1 of (9)."""
    return partial(MODELS["wolff_oren_nayar"].brdf, albedo=_ALBEDO, sigma_deg=sigma_deg, n=_N)


def _facets(sigma_deg: float) -> Brdf:
    """BRDF of facets by Wolff under the integral."""
    return partial(wolff_facets_brdf, albedo=_ALBEDO, sigma_deg=sigma_deg, n=_N)


def section_4() -> PaperFigure:
    """The combined model against the integral, and where Lambert's law does for smooth bodies."""
    return PaperFigure(
        number="§4",
        title="The combined model against its integral, and Lambert’s law on a smooth body",
        caption=(
            "The section has no figure for them. (a), (b): (3) with C<sub>1</sub> of (9), thin, "
            "and the integral that it stands for, V-cavities whose facets reflect by (7) with a "
            "constant ϱ; direct light, n = 1.5, albedo 0.9, plane of incidence. (c): by how much "
            "the BRDF of a smooth body, (7) with n = 1.5 and single-scattering albedo 1, is off "
            "Lambert’s law with the albedo that it has along the normal."
        ),
        panels=(
            _against_the_integral("a", _SLIGHT),
            _against_the_integral("b", _TRANSITION),
            _lambert_map(),
        ),
        checks=(*_near(), _neither_alone(), _five_percent()),
    )


def _against_the_integral(letter: str, sigma_deg: float) -> Panel:
    lines = []
    for k, t in enumerate(_INCIDENCES):
        lines.append(Line(_X, radiance(_facets(sigma_deg), t, _X), f"θᵢ {t:g}°", k))
        name = "(9)" if t == _INCIDENCES[-1] else ""
        lines.append(Line(_X, radiance(_combined(sigma_deg), t, _X), name, 4, thin=True))
    title = f"({letter}) σ = {sigma_deg:g}°"
    return chart(title, lines, Axis(VIEW, (-90.0, 90.0)), Axis("L/E₀ (1/sr)", (0.0, None)))


def _off(one: Brdf, other: Brdf, most_deg: float) -> float:
    """Largest difference of two BRDFs over the second, up to a view angle, in all incidences."""
    x = np.linspace(-most_deg, most_deg, 41)
    ratios = [radiance(one, t, x) / radiance(other, t, x) - 1 for t in _INCIDENCES]
    return float(np.max(np.abs(ratios)))


def _near() -> tuple[Check, Check]:
    within = [_off(_combined(s), _facets(s), 60.0) for s in (_SLIGHT, _TRANSITION)]
    beyond = [_off(_combined(s), _facets(s), 80.0) for s in (_SLIGHT, _TRANSITION)]
    return (
        Check(
            "(9) is a simple approximation to facets that reflect by the smooth model",
            f"within {100 * within[0]:.0f} % (σ = {_SLIGHT:g}°) and {100 * within[1]:.0f} % "
            f"({_TRANSITION:g}°) up to view angles of 60°, at incidences up to 60°",
            max(within) < 0.15,
        ),
        Check(
            "a property, not stated: it follows the integral near grazing, too",
            f"up to 80° it is off by {100 * beyond[0]:.0f} % and {100 * beyond[1]:.0f} %",
            max(beyond) < 0.15,
            "At oblique angles the facets that are seen are turned to the viewer: they send out "
            "more light than (9), which takes the angle to the mean surface.",
        ),
    )


def _neither_alone() -> Check:
    facets = _facets(_TRANSITION)
    combined = _off(_combined(_TRANSITION), facets, 60.0)
    smooth = _off(_combined(0.0), facets, 60.0)
    direct = partial(EXACT, albedo=1e-12, sigma_deg=_TRANSITION)
    dimming = float(radiance(facets, 0.0, np.zeros(1))[0] / radiance(direct, 0.0, np.zeros(1))[0])

    def rough(geometry: Geometry) -> FloatArray:
        return np.asarray(direct(geometry) * dimming)

    alone = _off(rough, facets, 60.0)
    return Check(
        "between smooth and rough the combination is more accurate than either model alone",
        f"σ = {_TRANSITION:g}°, up to 60°: off by {100 * combined:.0f} %, the smooth model by "
        f"{100 * smooth:.0f} %, the rough one, brought to the same level along the normal, by "
        f"{100 * alone:.0f} %",
        combined < min(smooth, alone),
    )


def _lambert_error() -> tuple[FloatArray, FloatArray]:
    """Angles (N,) in degrees, and Lambert's relative error (N, N) over both of them."""
    angle = np.linspace(0.0, 89.0, 90)
    brdf = SMOOTH(Geometry.from_degrees(theta_i=angle, theta_r=angle[:, None]))
    return angle, np.asarray(brdf[0, 0] / brdf - 1)


def _lambert_map() -> Panel:
    angle, error = _lambert_error()
    return contours(
        "(c) relative error of Lambert’s law", error, _ERRORS, angle, angle,
        ("angle of incidence θᵢ (°)", "view angle θᵣ (°)"), labelled=True,
    )  # fmt: skip


def _five_percent() -> Check:
    angle, error = _lambert_error()
    inside = angle <= 50
    worst = float(np.max(np.abs(error[np.ix_(inside, inside)])))
    along = np.abs(np.diag(error))
    end = float(np.interp(0.05, along, angle))
    return Check(
        "on smooth surfaces Lambert’s law is accurate to about 5 % if both angles are below 50°",
        f"at most {100 * worst:.1f} % off there; with equal angles 5 % is reached at {end:.0f}°",
        abs(worst - 0.05) < 0.015,
    )
