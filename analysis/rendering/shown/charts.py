"""Charts of a material: cross-sections, isophotes, reflectance maps, lobes, profiles as found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.rendering.reflectance_map import ReflectanceMap
from analysis.rendering.shown.shown import Shown
from analysis.rendering.surface import Surface
from analysis.report.figures.charts import margins
from analysis.report.style import GREY, GRID, INK, Drawing, style_of
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LAMBERT = "Lambert’s law"
_LEVELS = np.arange(0.1, 1.0, 0.1)  # of the brightest
_RINGS = 4


def sections_drawing(shown: Shown) -> Drawing:
    """Brightness across the body of the vase, for each lamp: pi times radiance over irradiance."""

    def draw(figure: Figure) -> None:
        grid = figure.subplots(
            1, len(shown.sections), sharey=True, gridspec_kw=margins(figure, 0.75, 0.15, 0.75, 0.6)
        )
        for ax, (lamp, pair) in zip(grid, shown.sections.items(), strict=True):
            curves = ((pair.model, shown.material.name, 0), (pair.lambert, _LAMBERT, 1))
            for values, name, number in curves:
                colour, _, dashes = style_of(number)
                label = name if lamp == 0 else None
                ax.plot(
                    np.sin(np.radians(shown.angles_deg)), np.pi * values,
                    color=colour, linestyle=dashes, label=label,
                )  # fmt: skip
            where = "at the viewer" if lamp == 0 else f"{lamp:g}° to the right"
            ax.set_title(f"lamp {where}", color=INK, loc="left", pad=5)
            ax.set_xlabel("place across the vase (radii)")
            ax.set_ylim(bottom=0)
            ax.set_xticks(np.arange(-1.0, 1.1, 0.5))
        grid[0].set_ylabel("π × radiance / irradiance")
        figure.legend(loc="upper center", ncols=2, frameon=False, handlelength=3.0)

    return Drawing(3.6, draw)


def isophotes_drawing(shown: Shown) -> Drawing:
    """Lines of equal brightness on sphere and cylinder in the last scene, in steps of 10 %."""
    panels = [
        (surface, law, values)
        for surface, pair in shown.isophotes.values()
        for law, values in ((shown.material.name, pair.model), (_LAMBERT, pair.lambert))
    ]

    def draw(figure: Figure) -> None:
        grid = figure.subplots(1, len(panels), gridspec_kw=margins(figure, 0.1, 0.1, 0.35, 0.1))
        for ax, (surface, law, values) in zip(grid, panels, strict=True):
            _isophotes(ax, surface, values)
            ax.set_title(law, color=INK, size=9)

    return Drawing(2.75, draw)


def _isophotes(ax: Axes, surface: Surface, values: FloatArray) -> None:
    ax.contour(surface.x, surface.y, surface.seen, levels=[0.5], colors=[GREY], linewidths=1.0)
    share = values / np.nanmax(values)
    ax.contour(surface.x, surface.y, share, levels=_LEVELS, cmap="viridis", linewidths=1.2)
    ax.set_aspect("equal")
    ax.set_axis_off()


def maps_drawing(shown: Shown) -> Drawing:
    """Reflectance maps by the model and by Lambert's law: lines in steps of 10 %."""

    def draw(figure: Figure) -> None:
        places = margins(figure, 0.75, 0.15, 0.4, 0.6)
        grid = figure.subplots(1, 2, gridspec_kw=places | {"wspace": 0.3})
        names = (shown.material.name, _LAMBERT)
        for ax, found, name in zip(grid, shown.maps, names, strict=True):
            _map(ax, found)
            ax.set_title(f"{name}: R² of a plane {found.plane_r2:.2f}", color=INK, pad=5)

    return Drawing(4.6, draw)


def _map(ax: Axes, found: ReflectanceMap) -> None:
    share = found.radiance / np.max(found.radiance)
    lines = ax.contour(found.p, found.q, share, levels=_LEVELS, cmap="viridis", linewidths=1.2)
    ax.clabel(lines, fmt="%.1f", fontsize=8)
    reach = found.p[-1]
    around = np.linspace(0, 2 * np.pi, 181)
    ax.plot(reach * np.cos(around), reach * np.sin(around), color=GREY, linewidth=0.8)
    ax.set_aspect("equal")
    ax.set_xlabel("p = ∂z/∂x")
    ax.set_ylabel("q = ∂z/∂y")


def lobes_drawing(shown: Shown) -> Drawing:
    """BRDF of each part of the model in the plane of incidence, with the lamp on the right."""

    def draw(figure: Figure) -> None:
        places = margins(figure, 0.1, 0.1, 0.75, 0.35)
        grid = figure.subplots(1, len(shown.lobes), gridspec_kw=places | {"wspace": 0.08})
        for ax, (theta_i, parts) in zip(grid, shown.lobes.items(), strict=True):
            _lobes(ax, shown, theta_i, dict(parts), labelled=ax is grid[0])
        figure.legend(loc="upper center", ncols=4, frameon=False, handlelength=3.0)

    return Drawing(3.5, draw)


def _lobes(
    ax: Axes, shown: Shown, theta_i: float, parts: dict[str, FloatArray], *, labelled: bool
) -> None:
    whole = np.sum(list(parts.values()), axis=0)
    lambert = np.full_like(whole, shown.material.albedo / np.pi)
    alone = {shown.material.name: (whole, 0)}
    several = {name: (values, number) for number, (name, values) in enumerate(parts.items(), 2)}
    curves = (several if len(parts) > 1 else {}) | alone | {_LAMBERT: (lambert, 1)}
    edge = 1.05 * float(max(np.max(whole), np.max(lambert)))
    angle = np.radians(shown.views_deg)
    for name, (values, number) in curves.items():
        colour, _, dashes = style_of(number)
        x, y = values * np.sin(angle), values * np.cos(angle)
        ax.plot(x, y, color=colour, linestyle=dashes, label=name if labelled else None)
    half = np.linspace(-np.pi / 2, np.pi / 2, 91)
    for ring in np.linspace(0, edge, _RINGS + 1)[1:]:
        ax.plot(ring * np.sin(half), ring * np.cos(half), color=GRID, linewidth=0.7, zorder=0)
    lamp = np.radians(theta_i)
    arrow = {"arrowstyle": "-|>", "color": INK, "shrinkA": 0, "shrinkB": 0}
    ends = [(r * edge * np.sin(lamp), r * edge * np.cos(lamp)) for r in (1.02, 1.2)]
    ax.annotate("", ends[0], ends[1], arrowprops=arrow)
    ax.text(1.25 * edge * np.sin(lamp), 1.22 * edge * np.cos(lamp), f"lamp {theta_i:g}°", color=INK)
    ax.plot([-edge, edge], [0, 0], color=INK, linewidth=2.0)
    ax.text(
        0, -0.04 * edge, f"outer ring: {edge:.3g} 1/sr", color=GREY, ha="center", va="top", size=9
    )
    ax.set_aspect("equal")
    ax.set_xlim(-1.1 * edge, 1.6 * edge)
    ax.set_ylim(-0.15 * edge, 1.35 * edge)
    ax.set_axis_off()


def profile_drawing(shown: Shown) -> Drawing:
    """Profile of the vase as found with two lamps, by Lambert's law and by the model."""
    stereo = shown.stereo[0]

    def draw(figure: Figure) -> None:
        ax = figure.subplots(gridspec_kw=margins(figure, 0.75, 0.15, 0.45, 0.6))
        curves = (
            (stereo.by_model.heights, shown.material.name, 0, 1.6),
            (stereo.by_lambert.heights, _LAMBERT, 1, 1.6),
            (stereo.heights, "true", 4, 0.9),
        )
        for heights, name, number, width in curves:
            colour, _, dashes = style_of(number)
            dashes = "-" if name == "true" else dashes
            ax.plot(stereo.places, heights, color=colour, linestyle=dashes, lw=width, label=name)
        ax.set_aspect("equal")
        ax.set_xlabel("place across the vase (radii)")
        ax.set_ylabel("height (radii)")
        figure.legend(loc="upper center", ncols=3, frameon=False, handlelength=3.0)

    return Drawing(4.4, draw)
