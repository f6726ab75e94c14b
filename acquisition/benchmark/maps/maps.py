"""Maps of where methods fail: each approximation, each fit, the window.

What to use when: `draw_maps` for all of them, as `gonio bench --maps` shows them. The regions are
those that the program itself goes by: the error against the integral, the bounds of
`analysis.accuracy.method`, the condition of a fit, the window's pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from acquisition.benchmark.maps.beckmann_lobe import TERMS, lobe_sums
from acquisition.benchmark.maps.map_style import (
    PERCENT,
    MapPicture,
    Reason,
    columns_of,
    contours,
    joined,
    level_legend,
    say_why,
)
from acquisition.benchmark.maps.smooth_dielectric import (
    EPSILON,
    ORDERS,
    order_bound,
    polynomial_bound,
)
from acquisition.benchmark.maps.window_map import window_picture
from analysis.accuracy.identifiability import LIMIT, condition_map
from analysis.models.rough.form_error import form_error
from analysis.models.rough.form_error_table import LIMIT_DEG
from analysis.models.specular.beckmann_spizzichino import poisson_sum
from analysis.report.style import INK, svg_of
from instrument.geometry import FloatArray, Geometry

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INCIDENCES_DEG = (15.0, 45.0, 75.0)
_PLANES_DEG = (0.0, 60.0)
_VIEWS_DEG = np.linspace(-LIMIT_DEG, LIMIT_DEG, 137)
_SIGMAS_DEG = np.linspace(0.25, 60.0, 61)
_ALBEDOS = (0.0, 1.0)  # between them the error is monotone

_FORMS: dict[str, tuple[str, str, tuple[Reason, ...]]] = {
    "lambert": (
        "Where Lambert’s law leaves the rough surface",
        "the same in every direction, whatever the roughness",
        (
            Reason("facets turned to the lamp send light back", 20, from_x=5),
            Reason("facets seen forward are turned from the lamp, or shadowed", 20, to_x=-5),
        ),
    ),
    "oren_nayar_qualitative": (
        "Where the qualitative form (36) leaves the integral",
        "1995, equation (36): C₂ without its b³, no C₃, no interreflection",
        (
            Reason("forward, (36) leaves out the negative C₂, shadow and masking", 20, to_x=-5),
            Reason("no interreflection, no C₃", 5, from_x=5),
        ),
    ),
    "oren_nayar": (
        "Where the functional form (33) + (34) leaves the integral",
        "1995, equations (33) and (34), fitted by their authors over all angles at once",
        (
            Reason("forward: shadow and masking beyond the fit of (33)", 5, to_x=-5),
            Reason("very rough: masking and interreflection beyond the fits", 5, from_x=5),
        ),
    ),
}  # fmt: skip


def draw_maps(folder: Path) -> list[MapPicture]:
    """All maps, in the order in which a page shows them. Nothing is written into `folder`."""
    del folder  # the pictures are text; whoever asks writes them
    return [
        *(rough_picture(name) for name in _FORMS),
        smooth_picture(),
        lobe_picture(),
        *(identifiability_picture(name) for name in ("oren_nayar", "oren_nayar+torrance_sparrow")),
        window_picture(),
    ]


# The rough surface.


def rough_picture(name: str) -> MapPicture:
    """A printed form against the integral over view angle and roughness, panel by panel."""
    title, what, reasons = _FORMS[name]
    panels = [(i, p) for p in _PLANES_DEG for i in _INCIDENCES_DEG]
    errors = {panel: rough_errors(name, *panel) for panel in panels}

    def draw(figure: Figure) -> None:
        axes = _panels(figure, 2, len(_INCIDENCES_DEG))
        for ax, panel in zip(axes, panels, strict=True):
            contours(ax, _VIEWS_DEG, _SIGMAS_DEG, errors[panel])
            say_why(ax, _VIEWS_DEG, _SIGMAS_DEG, errors[panel], reasons)
            plane = "in the plane of incidence" if panel[1] == 0 else f"Δφ = {panel[1]:g}°"
            ax.set_title(f"θᵢ = {panel[0]:g}°, {plane}", color=INK, loc="left", pad=4)
            ax.set_xticks([-60, -30, 0, 30, 60])
        _label(axes, 3, "← mirror side\u2003θᵣ (°)\u2003lamp’s side →", "roughness σ (°)")
        level_legend(figure)

    caption = (
        f"Error relative to the V-cavity integral, the larger of albedo 0 and 1: {what}. In the "
        "lower row the camera’s plane is turned by 60° from the lamp’s. Nearer to grazing than "
        f"{LIMIT_DEG:g}° nothing is mapped: there the program checks, or integrates."
    )
    rows = [
        columns_of(
            theta_i_deg=np.array(i), dphi_deg=np.array(plane), sigma_deg=_SIGMAS_DEG[::4, None],
            theta_r_deg=_VIEWS_DEG[::4], error_percent=errors[i, plane][::4, ::4],
        )
        for i, plane in panels
    ]  # fmt: skip
    return MapPicture(title, caption, svg_of(6.4, draw, f"map_{name}"), joined(rows))


def rough_errors(name: str, theta_i_deg: float, dphi_deg: float) -> FloatArray:
    """Errors of a form in percent over roughness and signed view angle, (sigma, theta_r)."""
    geometry = Geometry.from_degrees(theta_i=theta_i_deg, theta_r=_VIEWS_DEG, dphi=dphi_deg)
    rows = [
        [np.abs(form_error(name, geometry, albedo, float(sigma))) for albedo in _ALBEDOS]
        for sigma in _SIGMAS_DEG
    ]
    return np.asarray(100 * np.max(rows, axis=1))


# The smooth dielectric.


def smooth_picture() -> MapPicture:
    """Wolff's polynomial over angles and index, Chandrasekhar's orders over the albedo."""
    angles = np.linspace(0, 89.5, 60)
    index, rho = np.linspace(1.05, 3, 40), 1 - np.linspace(1, 0, 40) ** 2
    view, lamp = np.meshgrid(angles, angles)
    each_n = [_polynomial(Geometry.from_degrees(theta_i=angles, theta_r=angles), n) for n in index]
    at_n = _polynomial(Geometry.from_degrees(theta_i=lamp, theta_r=view), 1.5)
    orders = _orders(rho)
    maps: list[tuple[FloatArray, FloatArray, FloatArray, str, str, str, tuple[Reason, ...]]] = [
        (angles, angles, at_n, f"polynomial, ε = {EPSILON:g}, n = 1.5", "view angle θᵣ (°)",
         "incidence θᵢ (°)",
         (Reason("the fifth power rises too early", 20), Reason("F at normal is 0.065 for 0.04", 5)
          )),
        (angles, index, np.array(each_n), "polynomial, θᵢ = θᵣ", "θᵢ = θᵣ (°)", "index n",
         (Reason("ε stands for one n", 20, to_x=55), Reason("early rise", 20, from_x=55)
          )),
        (np.log2(np.array(ORDERS, dtype=np.float64)), rho, orders, "H of finite order, n = 1.5",
         "order N", "single-scattering albedo ϱ",
         (Reason("few streams inside: H and K too low", 5),)),
    ]  # fmt: skip

    def draw(figure: Figure) -> None:
        axes = _panels(figure, 1, 3, wspace=0.32, share=False)
        for ax, (x, y, values, title, label_x, label_y, reasons) in zip(axes, maps, strict=True):
            contours(ax, x, y, values)
            say_why(ax, x, y, values, reasons)
            ax.set_title(title, color=INK, loc="left", pad=4)
            ax.set_xlabel(label_x)
            ax.set_ylabel(label_y)
        axes[2].set_xticks(maps[2][0][[0, 1, 3, 5, 7]], [str(ORDERS[k]) for k in (0, 1, 3, 5, 7)])
        level_legend(figure)

    caption = (
        "Error of Wolff’s model (1998) with a polynomial for Fresnel’s reflectance, and, worst "
        "over all angles up to 85°, with Chandrasekhar’s H of finite order, against the exact "
        "one. They save two fifths of its time at most, nothing with many geometries."
    )
    rows = [
        columns_of(theta_i_deg=lamp[::3, ::3], theta_r_deg=view[::3, ::3], n=np.array(1.5),
                   error_percent=at_n[::3, ::3])
    ]  # fmt: skip
    title = "Where Wolff’s approximations leave the smooth dielectric"
    return MapPicture(title, caption, svg_of(3.9, draw, "map_smooth"), joined(rows))


def _polynomial(geometry: Geometry, n: float) -> FloatArray:
    ranges = {"n": (float(n), float(n))}
    return np.asarray(100 * polynomial_bound(geometry, ranges))


def _orders(rho: FloatArray) -> FloatArray:
    """Bounds in percent over the albedo and the order, at n = 1.5, of angles up to 85 degrees."""
    angles = np.linspace(0, 85, 18)
    geometry = Geometry.from_degrees(theta_i=angles[:, None], theta_r=angles)
    found = np.empty((rho.size, len(ORDERS)))
    for i, albedo in enumerate(rho):
        ranges = {"single_scattering_albedo": (float(albedo),) * 2, "n": (1.5, 1.5)}
        found[i] = [order_bound(order, geometry, ranges).max() for order in ORDERS]
    return 100 * found


# The lobe.


def lobe_picture() -> MapPicture:
    """The limits and the cut sums over the two numbers that they depend on."""
    log_g, log_x = np.linspace(-3, 5, 97), np.linspace(-3, 3, 73)
    g, x = np.meshgrid(10**log_g, 10**log_x)
    q = x * np.maximum(g, 1.0)
    exact = poisson_sum(g, q, lambda m, *_: 1 / m)
    seen = exact > 1e-30
    errors = [
        np.where(seen, 100 * np.abs(np.divide(s - exact, exact, where=seen, out=np.ones_like(s))),
                 100.0)
        for s in lobe_sums(g, q)
    ]  # fmt: skip
    names = ("g ≪ 1: the first term", "g ≫ 1: geometrical optics")
    titles = (*names, *(f"the first {count} terms" for count in TERMS))
    cut = "more terms count: m up to about g, more in the wings"
    reasons = (
        (Reason("rough in wavelengths: later terms count", 20, from_x=-1),
         Reason("wings, which only later terms reach", 20, to_x=-0.5)),
        (Reason("smooth in wavelengths: diffraction at the correlation length", 20, to_x=0.5),
         Reason("wings: facets so steep are not the ones that scatter", 20, from_x=1)),
        (Reason(cut, 20),),
        (Reason(cut, 20),),
    )  # fmt: skip

    def draw(figure: Figure) -> None:
        axes = _panels(figure, 2, 2, wspace=0.06)
        for ax, title, values, why in zip(axes, titles, errors, reasons, strict=True):
            contours(ax, log_g, log_x, values)
            say_why(ax, log_g, log_x, values, why)
            ax.set_title(title, color=INK, loc="left", pad=4)
            ax.set_xticks([-2, 0, 2, 4], ["0.01", "1", "100", "10⁴"])
            ax.set_yticks([-2, 0, 2], ["0.01", "1", "100"])
        _label(axes, 2, "optical roughness g", "q / max(g, 1), off the mirror →")
        level_legend(figure)

    caption = (
        "Error of the sum of 1991 (77) by its limits and cut short, against all of it: g is (19), "
        "q = v_xy²T²/4, 0 in the mirror direction. Where the sum is below 10⁻³⁰ it counts as "
        "missed. The program sums as many terms as it takes where no limit keeps the tolerance."
    )
    rows = [
        columns_of(
            method=[title] * values[::4, ::4].size, g=g[::4, ::4], q=q[::4, ::4],
            error_percent=values[::4, ::4],
        )
        for title, values in zip(titles, errors, strict=True)
    ]  # fmt: skip
    return MapPicture(
        "Where the limits of Beckmann’s lobe end", caption, svg_of(6.4, draw, "map_lobe"),
        joined(rows),
    )  # fmt: skip


# What a fit can tell.

_SETS: tuple[tuple[str, tuple[float, ...]], ...] = (
    ("θᵢ = 0°", (0.0,)),
    ("θᵢ = 30°", (30.0,)),
    ("θᵢ = 15°, 45°, 75°", (15.0, 45.0, 75.0)),
)
_OTHERS: dict[str, dict[str, float]] = {
    "oren_nayar": {"albedo": 0.8},
    "oren_nayar+torrance_sparrow": {"albedo": 0.8, "ks": 0.1},
}
_CONDITIONS = (10.0, 50.0, LIMIT, 1000.0)


def identifiability_picture(name: str) -> MapPicture:
    """The condition of a fit over roughness and the largest view angle of a standard sweep."""
    largest_deg, sigma_deg = np.linspace(5, 85, 33), np.linspace(1, 59, 21)
    panels = [(label, incidences, plane) for plane in (0.0, 90.0) for label, incidences in _SETS]
    make: Callable[..., FloatArray] = partial(condition_map, name, _OTHERS[name])
    found = [make(inc, plane, sigma_deg, largest_deg) for _, inc, plane in panels]
    reasons = (Reason("views too alike to part roughness from albedo", LIMIT),)

    def draw(figure: Figure) -> None:
        axes = _panels(figure, 2, len(_SETS))
        for ax, (label, _, plane), values in zip(axes, panels, found, strict=True):
            contours(ax, largest_deg, sigma_deg, values, _CONDITIONS)
            say_why(ax, largest_deg, sigma_deg, values, reasons)
            words = "in plane" if plane == 0 else "Δφ = 90°"
            ax.set_title(f"{label}, {words}", color=INK, loc="left", pad=4)
        _label(axes, 3, "largest view angle of the sweep (°)", "roughness σ (°)")
        level_legend(figure, _CONDITIONS, "")

    caption = (
        "Condition of the Jacobian of ln(BRDF), parameters in units of their domains, for 61 view "
        f"angles shared among the incidences. Above {LIMIT:g}, points of 1 % leave the worst "
        "combination of parameters uncertain by a quarter of a domain: the fit then says that the "
        f"data do not determine it. At small σ a gloss is a narrow lobe, which a sweep must meet. "
        f"Other parameters: {_said(_OTHERS[name])}."
    )
    rows = [
        columns_of(
            incidences_deg=[" ".join(f"{i:g}" for i in inc)] * values.size,
            dphi_deg=np.full(values.shape, plane), sigma_deg=sigma_deg[:, None],
            largest_view_deg=largest_deg, condition=values,
        )
        for (_, inc, plane), values in zip(panels, found, strict=True)
    ]  # fmt: skip
    title = f"What a sweep can tell: {name}"
    text = svg_of(6.2, draw, f"map_condition_{len(_OTHERS[name])}")
    return MapPicture(title, caption, text, joined(rows))


def _said(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in values.items())


# Layout.


def _panels(
    figure: Figure, rows: int, columns: int, wspace: float = 0.08, share: bool = True
) -> list[Axes]:
    height = figure.get_size_inches()[1]
    grid = {
        "left": 0.07, "right": 0.985, "top": 1 - 0.62 / height, "bottom": 0.52 / height,
        "wspace": wspace, "hspace": 0.24,
    }  # fmt: skip
    axes = figure.subplots(
        rows, columns, sharex=share, sharey=share, squeeze=False, gridspec_kw=grid
    )
    return list(axes.ravel())


def _label(axes: Sequence[Axes], columns: int, x: str, y: str) -> None:
    for ax in axes[-columns:]:
        ax.set_xlabel(x, fontsize=9.5)
    for ax in axes[::columns]:
        ax.set_ylabel(y)


__all__ = ["PERCENT", "MapPicture", "draw_maps"]
