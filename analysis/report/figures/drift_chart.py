"""Chart of the lamp's drift: its level at each drift check against the time of the scan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.report.data import LampLevels
from analysis.report.figures.charts import MAX_SERIES, margins
from analysis.report.style import GREY, NARROW_IN, WIDTH_IN, Drawing, style_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_LEAST_PERCENT = 0.02  # half of the range of an axis: what is less is no drift to look at


def drift_drawing(lamps: Sequence[LampLevels], *, narrow: bool = False) -> Drawing:
    """Changes of the level since the first check of each setting by hand, with u and the lines.

    The lines are those by which the readings are corrected.
    """
    shown = range(len(lamps))[: 1 if len(lamps) < 2 else MAX_SERIES]
    in_a_line = 1 if narrow else 3
    top = 0.2 + 0.24 * -(-len(shown) // in_a_line)

    def draw(figure: Figure) -> None:
        ax = figure.subplots(gridspec_kw=margins(figure, 0.8, 0.15, top, 0.58))
        ax.axhline(0.0, color=GREY, linewidth=0.8, zorder=1)
        for n, one in enumerate(lamps):
            _levels(ax, one, n, labelled=n in shown)
        low, high = ax.get_ylim()
        ax.set_ylim(min(low, -_LEAST_PERCENT), max(high, _LEAST_PERCENT))
        ax.set_xlabel("time since the first reading (min)")
        ax.set_ylabel("change of the lamp (%)")
        figure.legend(loc="upper center", ncols=in_a_line, frameon=False, handlelength=3.0)

    return Drawing(2.6 + top, draw, NARROW_IN if narrow else WIDTH_IN)


def _levels(ax: Axes, one: LampLevels, number: int, *, labelled: bool) -> None:
    colour, marker, dashes = style_of(number)
    at, change, u = one.time_s / 60.0, 100.0 * (one.level - 1.0), 100.0 * one.u
    ax.vlines(at, change - u, change + u, color=colour, linewidth=1.0, zorder=3)
    for stretch in np.unique(one.stretch):
        own = one.stretch == stretch
        ax.plot(at[own], change[own], color=colour, linestyle=dashes, linewidth=1.0, zorder=2)
    ax.plot(at, change, ls="", marker=marker, color=colour, zorder=4)
    if labelled:
        text = f"lamp at θᵢ = {one.theta_i_deg:.4g}°, camera at θᵣ = {one.theta_r_deg:.4g}°"
        ax.plot([], [], color=colour, marker=marker, linestyle=dashes, label=text)
