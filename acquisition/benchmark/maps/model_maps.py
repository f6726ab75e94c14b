"""Maps of where the approximations of reflectance models fail: rough surface, dielectric, lobe.

The regions are those by which the program itself chooses a method: the difference from the
integral, and the bounds of `analysis.accuracy.method`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from acquisition.benchmark.maps.beckmann_lobe import TERMS, lobe_sums
from acquisition.benchmark.maps.map_style import (
    Panel,
    Reason,
    columns_of,
    draw_panels,
    joined,
    label_axes,
)
from acquisition.benchmark.maps.smooth_dielectric import (
    EPSILON,
    ORDERS,
    order_bound,
    polynomial_bound,
)
from acquisition.benchmark.result import MapPicture
from analysis.models.rough.form_error import form_error
from analysis.models.rough.form_error_table import LIMIT_DEG
from analysis.models.specular.poisson_sums import poisson_sum
from analysis.report.style import svg_of
from instrument.geometry import FloatArray, Geometry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INCIDENCES_DEG = (15.0, 45.0, 75.0)
_PLANES_DEG = (0.0, 60.0)
_VIEWS_DEG = np.linspace(-LIMIT_DEG, LIMIT_DEG, 137)
_SIGMAS_DEG = np.linspace(0.25, 60.0, 61)
_ALBEDOS = (0.0, 1.0)  # the error is monotone between them

FORMS: dict[str, tuple[str, str, tuple[Reason, ...]]] = {
    "lambert": (
        "Where Lambert’s law fails on the rough surface",
        "the same in every direction, whatever the roughness",
        (
            Reason("facets that face the lamp send light back", 20, from_x=5),
            Reason("facets seen forward face away from the lamp, or are shadowed", 20, to_x=-5),
        ),
    ),
    "oren_nayar_qualitative": (
        "Where the qualitative form (36) differs from the integral",
        "1995, equation (36): C₂ without its b³, no C₃, no interreflection",
        (
            Reason("forward, (36) leaves out the negative C₂, shadowing and masking", 20, to_x=-5),
            Reason("no interreflection, no C₃", 5, from_x=5),
        ),
    ),
    "oren_nayar": (
        "Where the functional form (33) + (34) differs from the integral",
        "1995, equations (33) and (34), fitted by their authors over all angles at once",
        (
            Reason("forward: shadowing and masking beyond the fit of (33)", 5, to_x=-5),
            Reason("very rough: masking and interreflection beyond the fits", 5, from_x=5),
        ),
    ),
}  # fmt: skip
"""Title, description and reasons of each printed form."""


def rough_picture(name: str) -> MapPicture:
    """Map a printed form against the integral over view angle and roughness."""
    title, what, reasons = FORMS[name]
    errors = {
        (theta_i, dphi): rough_errors(name, theta_i, dphi)
        for dphi in _PLANES_DEG
        for theta_i in _INCIDENCES_DEG
    }
    panels = [
        Panel(_rough_title(*place), _VIEWS_DEG, _SIGMAS_DEG, values, reasons)
        for place, values in errors.items()
    ]

    def draw(figure: Figure) -> None:
        axes = draw_panels(figure, 2, panels)
        axes[0].set_xticks([-60, -30, 0, 30, 60])
        label_axes(axes, 3, "← mirror side\u2003θᵣ (°)\u2003lamp’s side →", "roughness σ (°)")

    caption = (
        f"Error relative to the V-cavity integral, the larger of albedo 0 and 1: {what}. In the "
        "lower row the camera’s plane is turned by 60° from the lamp’s. Beyond "
        f"{LIMIT_DEG:g}° nothing is mapped: there the program checks, or integrates."
    )
    rows = [
        columns_of(
            theta_i_deg=np.array(theta_i), dphi_deg=np.array(dphi),
            sigma_deg=_SIGMAS_DEG[::4, None], theta_r_deg=_VIEWS_DEG[::4],
            error_percent=values[::4, ::4],
        )
        for (theta_i, dphi), values in errors.items()
    ]  # fmt: skip
    return MapPicture(title, caption, svg_of(6.4, draw, f"map_{name}"), joined(rows))


def _rough_title(theta_i_deg: float, dphi_deg: float) -> str:
    plane = "in the plane of incidence" if dphi_deg == 0 else f"Δφ = {dphi_deg:g}°"
    return f"θᵢ = {theta_i_deg:g}°, {plane}"


def rough_errors(name: str, theta_i_deg: float, dphi_deg: float) -> FloatArray:
    """Return |errors| of a form in %, (sigma, theta_r) over roughness and signed view angle."""
    geometry = Geometry.from_degrees(theta_i=theta_i_deg, theta_r=_VIEWS_DEG, dphi=dphi_deg)
    rows = [
        [np.abs(form_error(name, geometry, albedo, float(sigma))) for albedo in _ALBEDOS]
        for sigma in _SIGMAS_DEG
    ]
    return np.asarray(100 * np.max(rows, axis=1))


def smooth_picture() -> MapPicture:
    """Map Wolff's polynomial over angles and index, Chandrasekhar's orders over the albedo."""
    angles = np.linspace(0, 89.5, 60)
    index, rho = np.linspace(1.05, 3, 40), 1 - np.linspace(1, 0, 40) ** 2
    view, lamp = np.meshgrid(angles, angles)
    each_n = [_polynomial(Geometry.from_degrees(theta_i=angles, theta_r=angles), n) for n in index]
    at_n = _polynomial(Geometry.from_degrees(theta_i=lamp, theta_r=view), 1.5)
    panels = [
        Panel(
            f"polynomial, ε = {EPSILON:g}, n = 1.5", angles, angles, at_n,
            (
                Reason("the fifth power rises too early", 20),
                Reason("F at normal incidence is 0.065, not 0.04", 5),
            ),
        ),
        Panel(
            "polynomial, θᵢ = θᵣ", angles, index, np.array(each_n),
            (
                Reason("ε is right for one n only", 20, to_x=55),
                Reason("early rise", 20, from_x=55),
            ),
        ),
        Panel(
            "H of finite order, n = 1.5", np.log2(np.array(ORDERS, dtype=np.float64)), rho,
            _orders(rho), (Reason("few streams inside: H and K too low", 5),),
        ),
    ]  # fmt: skip
    labels = (
        ("view angle θᵣ (°)", "incidence θᵢ (°)"),
        ("θᵢ = θᵣ (°)", "index n"),
        ("order N", "single-scattering albedo ϱ"),
    )

    def draw(figure: Figure) -> None:
        axes = draw_panels(figure, 1, panels, wspace=0.32, share=False)
        for ax, (x, y) in zip(axes, labels, strict=True):
            ax.set_xlabel(x)
            ax.set_ylabel(y)
        axes[2].set_xticks(panels[2].x[[0, 1, 3, 5, 7]], [str(ORDERS[k]) for k in (0, 1, 3, 5, 7)])

    caption = (
        "Error of Wolff’s model (1998) against the exact one: with a polynomial for Fresnel’s "
        "reflectance, and, worst over all angles up to 85°, with Chandrasekhar’s H of finite "
        "order. Both save two fifths of the time at most, and nothing with many geometries."
    )
    rows = columns_of(
        theta_i_deg=lamp[::3, ::3], theta_r_deg=view[::3, ::3], n=np.array(1.5),
        error_percent=at_n[::3, ::3],
    )  # fmt: skip
    title = "Where Wolff’s approximations of the smooth dielectric fail"
    return MapPicture(title, caption, svg_of(3.9, draw, "map_smooth"), rows)


def _polynomial(geometry: Geometry, n: float) -> FloatArray:
    ranges = {"n": (float(n), float(n))}
    return np.asarray(100 * polynomial_bound(geometry, ranges))


def _orders(rho: FloatArray) -> FloatArray:
    """Bounds in %, (albedo, order), at n = 1.5 and angles up to 85 degrees."""
    angles = np.linspace(0, 85, 18)
    geometry = Geometry.from_degrees(theta_i=angles[:, None], theta_r=angles)
    found = np.empty((rho.size, len(ORDERS)))
    for i, albedo in enumerate(rho):
        ranges = {"single_scattering_albedo": (float(albedo),) * 2, "n": (1.5, 1.5)}
        found[i] = [order_bound(order, geometry, ranges).max() for order in ORDERS]
    return 100 * found


def lobe_picture() -> MapPicture:
    """Map the limits and the truncated sums over the two numbers that they depend on."""
    log_g, log_x = np.linspace(-3, 5, 97), np.linspace(-3, 3, 73)
    g, x = np.meshgrid(10**log_g, 10**log_x)
    q = x * np.maximum(g, 1.0)
    exact = poisson_sum(g, q, lambda m, *_: 1 / m)
    visible = exact > 1e-30
    errors = [
        np.where(visible, 100 * np.abs(s - exact) / np.where(visible, exact, 1.0), 100.0)
        for s in lobe_sums(g, q)
    ]
    cut = "more terms are needed: m up to about g, more in the wings"
    reasons = {
        "g ≪ 1: the first term": (
            Reason("rough in wavelengths: later terms are needed", 20, from_x=-1),
            Reason("wings, which only later terms reach", 20, to_x=-0.5),
        ),
        "g ≫ 1: geometrical optics": (
            Reason("smooth in wavelengths: diffraction at the correlation length", 20, to_x=0.5),
            Reason("wings: facets so steep are not the ones that scatter", 20, from_x=1),
        ),
        **{f"the first {count} terms": (Reason(cut, 20),) for count in TERMS},
    }
    panels = [
        Panel(title, log_g, log_x, values, why)
        for (title, why), values in zip(reasons.items(), errors, strict=True)
    ]

    def draw(figure: Figure) -> None:
        axes = draw_panels(figure, 2, panels, wspace=0.06)
        axes[0].set_xticks([-2, 0, 2, 4], ["0.01", "1", "100", "10⁴"])
        axes[0].set_yticks([-2, 0, 2], ["0.01", "1", "100"])
        label_axes(axes, 2, "optical roughness g", "q / max(g, 1), off the mirror →")

    caption = (
        "Error of the limits and of the truncated sums of 1991 (77) against the whole sum: g is "
        "(19), q = v_xy²T²/4, 0 in the mirror direction. Where the sum is below 10⁻³⁰ it counts as "
        "missed. The program sums as many terms as needed where no limit keeps the tolerance."
    )
    rows = [
        columns_of(
            method=[panel.title] * panel.values[::4, ::4].size, g=g[::4, ::4], q=q[::4, ::4],
            error_percent=panel.values[::4, ::4],
        )
        for panel in panels
    ]  # fmt: skip
    svg = svg_of(6.4, draw, "map_lobe")
    return MapPicture("Where the limits of Beckmann’s lobe end", caption, svg, joined(rows))
