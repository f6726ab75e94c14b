"""Grid of axes in a figure whose margins at top and bottom are in inches."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def axes_grid(
    figure: Figure,
    rows: int,
    columns: int,
    *,
    top_in: float,
    bottom_in: float = 0.52,
    left: float = 0.075,
    wspace: float = 0.08,
    hspace: float = 0.24,
    share_x: bool = False,
    share_y: bool = False,
) -> list[Axes]:
    """Return the axes row by row; `left` is a fraction of the width, spaces of an axes' size."""
    height = figure.get_size_inches()[1]
    grid = {
        "left": left, "right": 0.985, "top": 1 - top_in / height, "bottom": bottom_in / height,
        "wspace": wspace, "hspace": hspace,
    }  # fmt: skip
    axes = figure.subplots(
        rows, columns, sharex=share_x, sharey=share_y, squeeze=False, gridspec_kw=grid
    )
    return list(axes.ravel())
