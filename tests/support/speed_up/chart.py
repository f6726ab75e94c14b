"""Chart of the speed-up of many fits, as measured and as Amdahl's law continues it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from acquisition.benchmark.output.axes_grid import axes_grid
from acquisition.benchmark.output.charts import standalone
from analysis.report.style import GREY, INK, style_of, svg_of
from tests.support.speed_up.speed_up import Timing, serial_share, speed_up

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 100  # processes


def chart(timings: Sequence[Timing]) -> str:
    """Return the chart as an SVG file; the first timing is that of one process."""
    share = serial_share(timings[0])
    workers = np.geomspace(1, MOST, 200)

    def draw(figure: Figure) -> None:
        (ax,) = axes_grid(figure, 1, 1, top_in=0.15, bottom_in=0.5)
        ax.plot(workers, workers, color=GREY, linestyle=":", label="in proportion")
        label = f"Amdahl's law, {100 * share:.2g} % of the work serial"
        colour, marker, _ = style_of(0)
        ax.plot(workers, [speed_up(share, n) for n in workers], color=colour, label=label)
        measured = [timings[0].wall_s / t.wall_s for t in timings]
        counts = [t.workers for t in timings]
        ax.plot(counts, measured, marker, color=INK, label="measured", zorder=3)
        ax.set(xscale="log", yscale="log", xlabel="processes", ylabel="speed-up")
        ticks = [1, 2, 5, 10, 20, 50, 100]
        ax.set_xticks(ticks, map(str, ticks))
        ax.set_yticks(ticks, map(str, ticks))
        ax.minorticks_off()
        ax.legend(frameon=False)

    return standalone(svg_of(3.6, draw, "speed_up"))
