"""Chart of the uncertainty budget: its sources stacked against the swept angle.

The top of the stack is the relative standard uncertainty of a point. Variances add, and not their
roots: each band is as high as its share of the variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.report.data import ReportData
from analysis.report.figures.charts import margins, panels_of, sweep_label, thinned
from analysis.report.style import GREY, INK, NARROW_IN, WIDTH_IN, Drawing
from analysis.report.sweeps import PlottedSweep
from analysis.report.swept_axis import AZIMUTH
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST = 6  # sources with a band of their own
# Dark and light in turn, so that neighbours differ on a printer without colours too.
_BANDS = ("#0072B2", "#F0A860", "#007A5A", "#E9B9DC", "#8A4A00", "#9BD0F0", "#C9C9C9")
OTHERS = "all others"


def stacks(data: ReportData, sweep: PlottedSweep) -> FloatArray:
    """Heights (sources, points) of the bands of a sweep in %, in the order of `ranked_sources`."""
    variances = np.array([data.sources[name][sweep.at] ** 2 for name in data.sources])
    if not variances.size:
        return np.zeros((0, sweep.at.size))
    variances = np.nan_to_num(variances[_order(data)])
    total = variances.sum(axis=0)
    share = np.divide(variances, total, out=np.zeros_like(variances), where=total > 0)
    heights: FloatArray = 100 * np.sqrt(total) * share
    shown = heights[:_MOST]
    rest = heights[_MOST:].sum(axis=0, keepdims=True)
    return np.concatenate([shown, rest]) if len(heights) > _MOST else shown


def with_budget(data: ReportData, sweeps: Sequence[PlottedSweep]) -> tuple[PlottedSweep, ...]:
    """Sweeps that have a point without flags whose uncertainty is known."""
    return tuple(s for s in sweeps if np.any(stacks(data, s)[:, ~s.flagged]))


def ranked_sources(data: ReportData) -> list[str]:
    """Names of the sources with a band of their own, the largest first, and of all others."""
    names = [list(data.sources)[n] for n in _order(data)]
    return [*names[:_MOST], OTHERS] if len(names) > _MOST else names


def _order(data: ReportData) -> list[int]:
    """Sources by their mean share of the variance, the largest first."""
    variances = np.nan_to_num(np.array(list(data.sources.values()))) ** 2
    total = variances.sum(axis=0)
    share = np.divide(variances, total, out=np.zeros_like(variances), where=total > 0)
    means = share.mean(axis=1)
    return [int(n) for n in np.argsort(-means, kind="stable")]


def budget_drawing(
    data: ReportData, sweeps: Sequence[PlottedSweep], *, narrow: bool = False
) -> Drawing:
    """Stacked bands of each sweep, with a legend in the order of the stack."""
    shown = thinned(sweeps)
    columns = 1 if narrow else min(len(shown), 3)
    rows = -(-len(shown) // columns)
    names = ranked_sources(data)
    in_a_line = 2 if narrow else 4
    lines = -(-len(names) // in_a_line)
    top = 0.3 + 0.24 * lines

    def draw(figure: Figure) -> None:
        grid = {"hspace": 0.4, "wspace": 0.08, **margins(figure, 0.75, 0.15, top + 0.1, 0.58)}
        axes = figure.subplots(
            rows, columns, sharex=True, sharey=True, squeeze=False, gridspec_kw=grid
        )
        for ax, sweep in zip(axes.flat, shown, strict=False):
            _panel(ax, data, sweep)
            label = sweep_label(sweep, len(panels_of(sweeps)))
            ax.set_title(label, color=INK, loc="left", pad=5)
        for ax in axes.flat[len(shown) :]:
            ax.set_visible(False)
        for ax in axes.flat[max(len(shown) - columns, 0) : len(shown)]:
            ax.set_xlabel(shown[0].axis.label)
            ax.tick_params(labelbottom=True)
        for ax in axes[:, 0]:
            ax.set_ylabel("relative u (%)")
        axes[0, 0].set_ylim(bottom=0.0)
        _legend(figure, names, in_a_line)

    return Drawing(0.75 + top + 2.2 * rows, draw, NARROW_IN if narrow else WIDTH_IN)


def _panel(ax: Axes, data: ReportData, sweep: PlottedSweep) -> None:
    good = ~sweep.flagged
    x, heights = sweep.x_deg[good], stacks(data, sweep)[:, good]
    if x.size < 2:  # a single point has no width
        x, heights = np.array([x.mean() - 1, x.mean() + 1]), np.repeat(heights, 2, axis=1)
    ax.stackplot(x, heights, colors=_BANDS, edgecolor="white", linewidth=0.5, zorder=2)
    ax.plot(x, heights.sum(axis=0), color=INK, linewidth=1.2, zorder=3)
    ax.plot(x, np.zeros(x.size), "|", color=GREY, ms=4, clip_on=False, zorder=4)
    if sweep.axis is not AZIMUTH:
        ax.set_xlim(-92, 92)
        ax.set_xticks(range(-60, 91, 60))


def _legend(figure: Figure, names: Sequence[str], in_a_line: int) -> None:
    from matplotlib.patches import Patch

    patches = [Patch(color=colour, label=name) for name, colour in zip(names, _BANDS, strict=False)]
    figure.legend(
        handles=patches, loc="upper center", ncols=in_a_line, frameon=False, handlelength=1.2
    )
