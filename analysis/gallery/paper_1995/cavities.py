"""Figures 5 to 9 of the 1995 paper: V-cavities, their shadow, masking and interreflection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.gallery.curves import rises
from analysis.gallery.figure import Check, Panel, PaperFigure
from analysis.gallery.panels import VIEW, Axis, Line, chart, sketch
from analysis.gallery.paper_1995.cavity_sketches import (
    bright_cavity,
    exchange_sketch,
    profile_sketch,
    projection_sketch,
    shadow_sketch,
)
from analysis.models.rough.v_cavity import (
    Directions,
    attenuation,
    interreflection_factor,
    unidirectional_single_slope,
)
from analysis.models.specular.torrance_sparrow import slope_density
from analysis.report.style import short_number
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SEED = 1995
_ZERO = np.zeros(())


def figure_5() -> PaperFigure:
    """Cross-section of a surface of V-cavities."""

    def draw(axes: Axes) -> None:
        profile_sketch(axes, 30.0, _SEED)

    theta = np.linspace(0.0, np.pi / 2, 20_001)
    whole = [
        float(np.trapezoid(slope_density(theta, np.radians(s)) * 2 * np.pi * np.sin(theta), theta))
        for s in (5.0, 30.0, 60.0)
    ]
    return PaperFigure(
        number="5",
        title="A surface of V-cavities",
        caption=(
            "Cross-section of long symmetric cavities. Each has two facets of one slope "
            "θ<sub>a</sub>, here drawn from the Gaussian (32) with σ = 30°; all facets have the "
            "same width. P(θ<sub>a</sub>) counts the surface that lies under facets of a slope (6)."
        ),
        panels=(sketch("", 1.7, draw),),
        checks=(
            Check(
                "the shares of all slopes add up to the whole surface: ∫ P dω = 1 with the c of "
                "(32)",
                ", ".join(f"{w:.6f}" for w in whole) + " at σ = 5°, 30°, 60°",
                all(abs(w - 1) < 1e-6 for w in whole),
            ),
        ),
    )


_SLOPE, _LAMP = 30.0, 45.0  # degrees, Fig. 6; the text states none


def figure_6() -> PaperFigure:
    """Brightness of a cavity whose facets are lit unequally."""
    x = np.linspace(-90.0, 90.0, 361)
    y = _cavity_radiance(x)
    flat = np.full_like(x, np.cos(np.radians(_LAMP)) / np.pi)
    lines = (Line(x, y, "cavity, albedo 1", 0), Line(x, flat, "flat Lambertian", 4))

    def draw(axes: Axes) -> None:
        bright_cavity(axes, _SLOPE, _LAMP)

    return PaperFigure(
        number="6",
        title="A cavity grows brighter as the viewer moves towards the lamp",
        caption=(
            f"Left: cavity of slope {_SLOPE:g}°, lit from {_LAMP:g}°; grey: radiance of each "
            "facet. Right: radiance of the cavity over E<sub>0</sub>, direct light, equation (28)."
        ),
        panels=(
            sketch("", 2.4, draw),
            chart("", lines, Axis(VIEW, (-90.0, 90.0)), Axis("L/E₀ (1/sr)", (0.0, None))),
        ),
        checks=(_towards_the_lamp(x, y), _disparity()),
    )


def _cavity_radiance(theta_r: FloatArray) -> FloatArray:
    """Radiance over E_0 of direct light at signed view angles (N,) in degrees, albedo 1."""
    phi_r = np.where(theta_r < 0, np.pi, 0.0)
    towards = Directions(np.radians(np.array(_LAMP)), _ZERO, np.radians(np.abs(theta_r)), phi_r)
    direct = unidirectional_single_slope(towards, np.radians(np.array(_SLOPE)), _ZERO).direct
    return np.asarray(direct * np.cos(np.radians(_LAMP)) / np.pi)


def _towards_the_lamp(x: FloatArray, y: FloatArray) -> Check:
    low, high = (float(np.interp(t, x, y)) for t in (-45.0, 45.0))
    return Check(
        "the radiance of the cavity increases as the observer approaches the lamp",
        f"from {low:.3f} at −45° to {high:.3f} at 45°, never falling between −90° and 90°",
        rises(y) and high > low,
    )


def _disparity() -> Check:
    incidences = np.array([0.0, 15.0, 30.0, 45.0, 60.0])
    ratio = np.cos(np.radians(incidences - 30)) / np.cos(np.radians(incidences + 30))
    return Check(
        "the disparity in brightness of the two facets increases with the angle of incidence",
        "bright over dark facet "
        + ", ".join(short_number(float(r), 3) for r in ratio[:-1])
        + " at 0°, 15°, 30° and 45°; at 60° the dark one gets no light",
        rises(ratio[:-1]),
    )


def _shadow_panel(letter: str, word: str, name: str) -> Panel:
    def draw(axes: Axes) -> None:
        shadow_sketch(axes, 40.0, 65.0, word, name)

    return sketch(f"({letter}) {'shadowing' if letter == 'a' else 'masking'}", 2.3, draw)


def figure_7() -> PaperFigure:
    """Shadow and masking in a cavity."""
    return PaperFigure(
        number="7",
        title="Shadowing and masking in a V-cavity",
        caption=(
            "Slope 40°, lamp or camera at 65°. The rim of one facet hides the lower part m of the "
            "other: equation (13); both together give the attenuation (14)."
        ),
        panels=(
            _shadow_panel("a", "lamp", "mₛ"),
            _shadow_panel("b", "camera", "mᵥ"),
        ),
        checks=(_rays(), _thresholds()),
    )


def _draws(size: int, kinds: int) -> FloatArray:
    return np.random.default_rng(_SEED).uniform(0.02, 1.55, (kinds, size))


def _rays() -> Check:
    """Hidden part by cutting the ray over one rim with the other facet, against (16)."""
    theta_a, theta = _draws(20_000, 2)
    # Rim (cos, sin); ray towards (-sin theta, -cos theta); other facet s (-cos, sin), 0 <= s <= 1.
    s = -np.cos(theta_a + theta) / np.cos(theta_a - theta)
    rim_x, rim_y = np.cos(theta_a), np.sin(theta_a)
    step = (rim_x + s * np.cos(theta_a)) / np.sin(theta)  # along the ray until x is the facet's
    landed = rim_y - step * np.cos(theta)
    off = np.max(np.abs(landed - s * np.sin(theta_a)) * np.minimum(1, np.tan(theta)))
    towards = Directions(theta, np.zeros_like(theta), np.zeros_like(theta), np.zeros_like(theta))
    lit = attenuation(towards, theta_a, np.zeros_like(theta))
    worst = float(np.max(np.abs(lit - np.clip(1 - s, 0, 1))))
    return Check(
        "the hidden part is m/w = −cos(θ<sub>a</sub> + θ)/cos(θ<sub>a</sub> − θ) (13)",
        f"20 000 random rays over the rim meet the facet there to {short_number(float(off), 1)}, "
        f"and the model’s attenuation agrees to {short_number(worst, 1)}",
        bool(off < 1e-9) and worst < 1e-12,
    )


def _thresholds() -> Check:
    theta_a, theta = _draws(20_000, 2)
    towards = Directions(theta, np.zeros_like(theta), np.zeros_like(theta), np.zeros_like(theta))
    whole = attenuation(towards, theta_a, np.zeros_like(theta)) >= 1 - 1e-12
    right = whole == (theta_a + theta <= np.pi / 2 + 1e-12)
    return Check(
        "no shadow falls as long as θ<sub>a</sub> + θ<sub>i</sub> ≤ 90°",
        f"{100 * float(np.mean(right)):.2f} % of 20 000 random cavities",
        bool(np.all(right)),
    )


def figure_8() -> PaperFigure:
    """Angles projected onto the plane across a cavity."""
    azimuth = np.linspace(0.0, 180.0, 361)
    lines = [
        Line(azimuth, np.degrees(_projected(np.radians(t), np.radians(azimuth))), f"θ {t}°", k)
        for k, t in enumerate((20, 45, 60, 75))
    ]
    return PaperFigure(
        number="8",
        title="Directions projected onto the plane across a cavity",
        caption=(
            "Facets are long: only the projection of a direction onto the plane across the cavity "
            "counts for shadow and masking. tan θ′ = tan θ cos(φ − φ<sub>a</sub>); (14) then "
            "becomes (15)."
        ),
        panels=(
            sketch("", 2.6, projection_sketch),
            chart(
                "",
                lines,
                Axis("azimuth φ − φₐ (°)", (0.0, 180.0), (0, 45, 90, 135, 180)),
                Axis("projected angle θ′ (°)", (-90.0, 90.0)),
            ),
        ),
        checks=(_projection(),),
    )


def _projected(theta: FloatArray, phi: FloatArray) -> FloatArray:
    return np.asarray(np.arctan(np.tan(theta) * np.cos(phi)))


def _projection() -> Check:
    theta_i, theta_r, theta_a = _draws(20_000, 3)
    phi_i, phi_r = np.random.default_rng(_SEED + 1).uniform(0, 2 * np.pi, (2, 20_000))
    zero = np.zeros_like(theta_i)
    general = attenuation(Directions(theta_i, phi_i, theta_r, phi_r), theta_a, zero)
    i, r = _projected(theta_i, phi_i), _projected(theta_r, phi_r)
    across = Directions(
        np.abs(i), np.where(i < 0, np.pi, 0.0), np.abs(r), np.where(r < 0, np.pi, 0.0)
    )
    worst = float(np.max(np.abs(general - attenuation(across, theta_a, zero))))
    return Check(
        "the attenuation of arbitrary directions (15) is that of their projections in (14)",
        f"differs by at most {short_number(worst, 1)} for 20 000 random directions",
        worst < 1e-9,
    )


def figure_9() -> PaperFigure:
    """Exchange of light between the facets of a cavity."""
    theta_a = np.linspace(0.0, 90.0, 181)
    lines = []
    for k, hidden in enumerate((0.0, 0.25, 0.5, 0.75)):
        factor = interreflection_factor(np.array(hidden), np.array(hidden), np.radians(theta_a))
        lines.append(Line(theta_a, factor, f"m/w {hidden:g}", k))
    return PaperFigure(
        number="9",
        title="Interreflection in a V-cavity",
        caption=(
            "Light goes from y on the adjacent facet to x on this one, with the kernel (19); the "
            "parts m are not seen or not lit. Right: interreflection factor (24) against the "
            "slope, equal parts hidden on both."
        ),
        panels=(
            sketch("", 2.4, exchange_sketch),
            chart(
                "", lines, Axis("slope θₐ (°)", (0.0, 90.0)), Axis("interreflection factor (24)")
            ),
        ),
        checks=(_kernel_integral(), _open_cavity()),
    )


def _kernel_integral() -> Check:
    rng = np.random.default_rng(_SEED)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    worst = 0.0
    for _ in range(100):
        masked, shadowed = rng.uniform(0.05, 0.95, 2)
        theta_a = np.array(rng.uniform(0.1, 1.5))
        t = masked + (1 - masked) * (nodes[:, None] + 1) / 2
        r = shadowed + (1 - shadowed) * (nodes + 1) / 2
        distance2 = t * t + 2 * t * r * np.cos(2 * theta_a) + r * r
        kernel = np.pi * np.sin(2 * theta_a) ** 2 / 2 * t * r / distance2**1.5
        area = (1 - masked) * (1 - shadowed) / 4
        integral = float(weights @ kernel @ weights) * area
        closed = float(interreflection_factor(np.array(masked), np.array(shadowed), theta_a))
        worst = max(worst, abs(integral - closed))
    return Check(
        "the integral (23) of the kernel (19) has the closed form (24)",
        f"100 random cavities, by quadrature: differs by at most {short_number(worst, 1)}",
        worst < 1e-6,
    )


def _open_cavity() -> Check:
    theta_a = np.radians(np.array([10.0, 30.0, 60.0, 85.0]))
    factor = interreflection_factor(np.zeros(4), np.zeros(4), theta_a)
    worst = float(np.max(np.abs(factor - np.pi * (1 - np.cos(theta_a)))))
    return Check(
        "for a cavity seen and lit whole it is π(1 − cos θ<sub>a</sub>), the first factor of (48)",
        f"differs by at most {short_number(worst, 1)}",
        worst < 1e-12,
    )
