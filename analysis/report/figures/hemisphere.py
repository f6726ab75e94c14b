"""Map of the hemisphere above the sample: measured directions, coloured by their value.

Only what was measured is drawn: between the points nothing is interpolated. The direction is
projected onto the sample's plane: the distance from the centre is sin(theta_r), so that equal areas
are equal projected solid angles. The lamp stands on the right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.report.data import ReportData
from analysis.report.style import GREY, GRID, INK, NARROW_IN, WIDTH_IN, Drawing, Marks
from analysis.report.swept_axis import SAME_ANGLE_DEG
from instrument.geometry import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

MOST = 6  # incidences, evenly selected
_COLOURS = "cividis"  # of even lightness steps, also for the colour-blind
_LOG_RATIO = 40.0
_RINGS_DEG = (30, 60, 90)
_LEAST_TILT_DEG = 1.0  # a view nearer to the normal has no azimuth
_BAR_CELLS = 64
_LABELS_AT_RAD = np.radians(-82.0)  # azimuth of the rings' labels, beside the usual ones


@dataclass(frozen=True, slots=True)
class HemisphereMap:
    """Points (P,) of one incidence: numbers within the run, place on the disc, and values.

    x points to the lamp's side, both places are in units of the disc's radius.
    """

    theta_i_deg: float
    numbers: IntArray
    x: FloatArray
    y: FloatArray
    value: FloatArray
    flagged: BoolArray


def hemisphere_maps(data: ReportData) -> tuple[HemisphereMap, ...]:
    """Return one map for each incidence that was seen out of its plane, of at most `MOST`."""
    value, _ = data.value_and_u
    columns = (value, data.theta_i_deg, data.dphi_deg, data.theta_r_deg)
    usable = np.logical_and.reduce([np.isfinite(column) for column in columns])
    usable &= ~(data.flagged & (value <= 0))
    theta_i = np.round(data.theta_i_deg[usable], 1)
    maps = [
        _map_of(data, value, np.flatnonzero(usable)[theta_i == at]) for at in np.unique(theta_i)
    ]
    found = [one for one in maps if _out_of_plane(one)]
    kept = np.linspace(0, len(found) - 1, min(MOST, len(found))).round().astype(int)
    return tuple(found[i] for i in kept)


def _map_of(data: ReportData, value: FloatArray, at: IntArray) -> HemisphereMap:
    radius, dphi = np.sin(np.radians(data.theta_r_deg[at])), np.radians(data.dphi_deg[at])
    return HemisphereMap(
        theta_i_deg=float(np.median(data.theta_i_deg[at])),
        numbers=at,
        x=radius * np.cos(dphi),
        y=radius * np.sin(dphi),
        value=value[at],
        flagged=data.flagged[at],
    )


def _out_of_plane(one: HemisphereMap) -> bool:
    least = np.sin(np.radians(_LEAST_TILT_DEG))
    azimuth = np.abs(np.arctan2(one.y, np.abs(one.x)))
    tilted = np.hypot(one.x, one.y) > least
    return bool(np.any(tilted & (azimuth > np.radians(SAME_ANGLE_DEG)) & ~one.flagged))


def hemisphere_drawing(
    maps: Sequence[HemisphereMap], quantity: str, *, narrow: bool = False
) -> Drawing:
    """Discs side by side on one scale of colours, with its bar below."""
    columns = min(len(maps), 1 if narrow else 3)
    rows = -(-len(maps) // columns)
    width_in = NARROW_IN if narrow else WIDTH_IN
    disc_in = min(width_in / columns, 4.0)
    height_in = rows * (disc_in + 0.25) + 0.8
    norm = _norm(maps)

    def draw(figure: Figure) -> list[Marks]:
        marks = []
        for n, one in enumerate(maps):
            row, column = divmod(n, columns)
            left = (width_in - columns * disc_in) / 2 + column * disc_in
            bottom = height_in - (row + 1) * (disc_in + 0.25)
            box = (left / width_in, bottom / height_in, disc_in / width_in, disc_in / height_in)
            marks.append(_disc(figure.add_axes(box), one, norm, disc_in))
        bar_in = min(width_in - 1.0, 5.0)
        left, width = (width_in - bar_in) / 2 / width_in, bar_in / width_in
        bar = figure.add_axes((left, 0.5 / height_in, width, 0.14 / height_in))
        _colour_bar(bar, norm, quantity)
        return marks

    return Drawing(height_in, draw, width_in)


def _norm(maps: Sequence[HemisphereMap]) -> Normalize:
    """Scale of the colours, from the values without flag; logarithmic for a large range."""
    from matplotlib.colors import LogNorm, Normalize

    values = np.concatenate([one.value[~one.flagged] for one in maps])
    low, high = float(values.min()), float(values.max())
    if low > 0 and high > _LOG_RATIO * low:
        return LogNorm(low, high)
    return Normalize(low, high if high > low else low + max(abs(low), 1.0) * 1e-3)


def _disc(ax: Axes, one: HemisphereMap, norm: Normalize, disc_in: float) -> Marks:
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set_xlim(-1.22, 1.22)
    ax.set_ylim(-1.14, 1.30)
    _frame(ax)
    good = ~one.flagged
    plain: dict[str, Any] = {"edgecolors": GREY, "linewidths": 0.3, "zorder": 3}
    plain["s"] = _marker_pt(one, disc_in) ** 2
    ax.scatter(one.x[good], one.y[good], c=one.value[good], norm=norm, cmap=_COLOURS, **plain)
    ax.plot(one.x[~good], one.y[~good], ls="", marker="x", ms=6, c=INK, mew=1.2, zorder=4)
    lamp = np.sin(np.radians(one.theta_i_deg))
    ax.plot([lamp], [0.0], ls="", marker="*", ms=11, mfc="white", mec=INK, zorder=5)
    ax.text(-1.2, 1.24, f"lamp at θᵢ = {one.theta_i_deg:.4g}°", va="top", color=INK, size=10.5)
    return Marks(ax, one.x, one.y, one.numbers)


def _frame(ax: Axes) -> None:
    around = np.linspace(0.0, 2 * np.pi, 181)
    for ring in _RINGS_DEG:
        radius = np.sin(np.radians(ring))
        colour, width = (GREY, 1.0) if ring == 90 else (GRID, 0.7)
        ax.plot(radius * np.cos(around), radius * np.sin(around), color=colour, lw=width, zorder=1)
        x, y = np.cos(_LABELS_AT_RAD) * radius, np.sin(_LABELS_AT_RAD) * radius
        ax.text(x, y, f"{ring}°", ha="center", va="center", size=8, color=GREY, zorder=4)
    for azimuth in range(0, 180, 45):
        x, y = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
        ax.plot([-x, x], [-y, y], color=GRID, lw=0.7, zorder=0)
    for azimuth, place in ((0, (1.04, 0.0)), (90, (0.0, 1.04)), (180, (-1.04, 0.0))):
        side = {0: "left", 90: "center", 180: "right"}[azimuth]
        ax.text(*place, f"{azimuth}°", ha=side, va="bottom" if azimuth == 90 else "center",
                size=8, color=GREY)  # fmt: skip


def _marker_pt(one: HemisphereMap, disc_in: float) -> float:
    """Diameter of a marker in points: less than the spacing of as many points spread evenly."""
    spacing = np.sqrt(np.pi / max(one.x.size, 1)) * disc_in * 72 / 2.44
    return float(np.clip(0.8 * spacing, 3.0, 11.0))


def _colour_bar(ax: Axes, norm: Normalize, quantity: str) -> None:
    """Bar of the colours in vectors, with the axis of the values."""
    edges = np.asarray(norm.inverse(np.linspace(0.0, 1.0, _BAR_CELLS + 1)))
    middle = np.asarray(norm.inverse((np.arange(_BAR_CELLS) + 0.5) / _BAR_CELLS))
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    colours = colormaps[_COLOURS](norm(middle))
    ax.bar(
        edges[:-1],
        1.0,
        np.diff(edges),
        align="edge",
        color=colours,
        edgecolor=colours,
        linewidth=0.4,
    )
    if isinstance(norm, LogNorm):
        ax.set_xscale("log")
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(0.0, 1.0)
    ax.set_yticks([])
    ax.grid(visible=False)
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(quantity)
