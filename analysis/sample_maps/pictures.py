"""Pictures of maps, side by side on a screen and one below the other on a phone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analysis.report.style import INK, NARROW_IN, WIDTH_IN, Drawing, embedded_svg, figure_html
from analysis.sample_maps.sample_map import SampleMap
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# In inches, about a picture: axis on its left, title above it, axis below it, and its bar of
# colours with the numbers, a gap from it.
_LEFT, _TOP, _BOTTOM, _GAP, _BAR, _NUMBERS = 0.65, 0.32, 0.58, 0.1, 0.16, 0.72
_LARGEST_IN, _TALLEST = 4.2, 1.5  # side along x; height over it


class Panel(NamedTuple):
    """A map: its title, values (rows, columns) in one unit, and percentiles that colours span.

    Values (rows, columns, 4) are the colours themselves, as of `screen_colours`.
    """

    title: str
    values: FloatArray
    shown: tuple[float, float]


def maps_html(found: SampleMap, panels: Sequence[Panel], label: str, caption: str) -> str:
    """Return the panels as a figure of the page, on a screen at most two in a row."""
    columns = min(len(panels), 2)
    name = panels[0].title.split()[0]
    wide = embedded_svg(_drawing(found, panels, columns, WIDTH_IN), f"maps-{name}")
    narrow = embedded_svg(_drawing(found, panels, 1, NARROW_IN), f"narrow-maps-{name}")
    return figure_html([wide], label, caption, [narrow])


def _drawing(found: SampleMap, panels: Sequence[Panel], columns: int, width_in: float) -> Drawing:
    beside = _LEFT + _GAP + _BAR + _NUMBERS
    rows, cells = found.chi2.shape
    side = min(width_in / columns - beside, _LARGEST_IN, _LARGEST_IN * _TALLEST * cells / rows)
    size = side, side * rows / cells
    pitch = _TOP + size[1] + _BOTTOM
    total = pitch * -(-len(panels) // columns)

    def draw(canvas: Figure) -> None:
        to_figure = np.array([width_in, total] * 2)
        for number, panel in enumerate(panels):
            row, column = divmod(number, columns)
            left, bottom = column * width_in / columns + _LEFT, total - (row + 1) * pitch + _BOTTOM
            axes, bar = (
                canvas.add_axes(tuple(np.array(box) / to_figure))
                for box in (
                    (left, bottom, *size),
                    (left + side + _GAP, bottom, _BAR, size[1]),
                )
            )
            _draw_map(canvas, axes, bar, found, panel)

    return Drawing(total, draw, width_in)


def screen_colours(albedo: FloatArray) -> FloatArray:
    """Return the colours (rows, columns, 4) of albedos (rows, columns, 3) on a screen, 0 to 1.

    By the curve of sRGB (IEC 61966-2-1); the fourth is 0 for a place without an albedo, else 1.
    """
    known = np.isfinite(albedo).all(axis=-1, keepdims=True)
    linear = np.clip(np.where(known, albedo, 0.0), 0.0, 1.0)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.concatenate([curved, known.astype(np.float64)], axis=-1)


def _draw_map(canvas: Figure, axes: Axes, bar: Axes, found: SampleMap, panel: Panel) -> None:
    values = panel.values
    half = found.cell_mm / 2
    extent = (
        found.x_mm[0] - half, found.x_mm[-1] + half, found.y_mm[-1] - half, found.y_mm[0] + half,
    )  # fmt: skip
    axes.grid(visible=False)
    axes.set_title(panel.title, color=INK, loc="left", pad=6)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)", labelpad=1)
    if values.ndim == found.chi2.ndim + 1:
        axes.imshow(values, extent=extent, interpolation="nearest")
        bar.remove()
        return
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, panel.shown) if known.size else (0.0, 1.0)
    if high - low < 1e-9 * max(abs(high), 1e-12):
        low, high = low - 0.5 * abs(low or 1.0), high + 0.5 * abs(high or 1.0)
    drawn = axes.imshow(
        values, vmin=low, vmax=high, extent=extent, cmap="viridis", interpolation="nearest"
    )
    beyond = bool(np.any(known < low)), bool(np.any(known > high))
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max"}
    canvas.colorbar(drawn, cax=bar, extend=ends.get(beyond, "both"))
