"""Page of a map: what the sample is like, a picture of each parameter and its u, and histograms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.report.figures.charts import margins
from analysis.report.style import (
    CSS,
    INK,
    escaped,
    figure_html,
    format_value,
    html_page,
    row_html,
    short_number,
    svg_of,
    table_html,
)
from analysis.sample_maps.sample_map import UNITS, SampleMap
from analysis.sample_maps.spread import Spread
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of the cells, whose values the colours span; u rises where fewer views show a cell, at the edges.
_SHOWN_PERCENT, _SHOWN_U_PERCENT = (1.0, 99.0), (1.0, 94.0)
_BINS = 80
_HIGH_IN, _HISTOGRAM_IN = 4.3, 3.0
_NAMES = {"albedo": "albedo", "sigma_deg": "σ (°)", "ks": "kₛ"}
_MOST_CHI2 = 3.0  # of the colours of chi2 over its expectation


def map_html(found: SampleMap) -> str:
    """Return the page; the same map gives the same text."""
    body = [_head(found), _verdict(found), _pictures(found), _numbers(found), _misfit(found)]
    return html_page(f"Map of {found.sample}", CSS, body)


def _head(found: SampleMap) -> str:
    rows, columns = found.chi2.shape
    return (
        f"<header>\n<h1>Map of the sample: {escaped(found.title)}</h1>\n"
        f'<p class="sample">Sample: <b>{escaped(found.sample)}</b></p>\n'
        f'<p class="soft">{columns} × {rows} cells of {found.cell_mm:g} mm; {found.model} fitted '
        f"in each, at up to {found.geometries} geometries.</p>\n</header>"
    )


def _verdict(found: SampleMap) -> str:
    kind = "adequate" if found.uniform else "warning"
    said = [_said(found, name) for name in found.values]
    notes = "".join(f"<li>{escaped(note)}</li>" for note in found.notes)
    listed = f"\n<ul>{notes}</ul>" if notes else ""
    return (
        f'<section class="verdict {kind}">\n<p class="state">'
        f"{'uniform' if found.uniform else 'not uniform'}</p>\n"
        f'<p class="headline">{escaped(found.headline())}</p>\n'
        f"<p>{escaped(' '.join(filter(None, said)))}</p>{listed}\n</section>"
    )


def _said(found: SampleMap, name: str) -> str:
    """Return the spread of a parameter in words, beside the mean curve's value."""
    spread, (value, u) = found.spread(name), found.mean[name]
    if spread is None:
        return ""
    unit, label = UNITS[name], _NAMES[name].removesuffix(" (°)")
    mean = f"the mean curve of the window has {format_value(value, u, unit)}"
    if spread.uniform:
        return f"{label}: {_short(spread.median, unit)} in the median; {mean}."
    return (
        f"{label} differs by {_short(spread.beyond, unit)} (standard deviation) beyond u, about "
        f"{_short(spread.median, unit)}; {mean}, which is that of a mixture."
    )


def _short(value: float, unit: str) -> str:
    return f"{short_number(value, 3)}{unit}"


def _pictures(found: SampleMap) -> str:
    names = tuple(found.values)

    def draw(canvas: Figure) -> None:
        places = {"hspace": 0.3, "wspace": 0.3, **margins(canvas, 0.75, 0.6, 0.6, 0.5)}
        grid = canvas.add_gridspec(len(names), 2, **places)
        for row, name in enumerate(names):
            left, right = (canvas.add_subplot(grid[row, column]) for column in range(2))
            _picture(canvas, left, found, found.values[name], _NAMES[name])
            u_title = f"u of {_NAMES[name]}"
            _picture(canvas, right, found, found.u(name), u_title, _SHOWN_U_PERCENT)

    svg = svg_of(0.5 + _HIGH_IN * len(names), draw, "maps")
    caption = (
        "Left: each cell's value; right: its standard uncertainty (k = 1), with what all cells "
        "share. Places are seen along the normal and count from the rotation axis; at Δφ = 0° the "
        "lamp is at +x. The colours span nearly all cells; a pointed end of their bar holds the "
        "rest. White: no fit."
    )
    return f'<h2 id="maps">Maps</h2>\n{figure_html([svg], "Maps of the sample", caption)}'


def _picture(
    canvas: Figure,
    axes: Axes,
    found: SampleMap,
    values: FloatArray,
    title: str,
    shown: tuple[float, float] = _SHOWN_PERCENT,
) -> None:
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, shown) if known.size else (0.0, 1.0)
    if high - low < 1e-9 * max(abs(high), 1e-12):
        low, high = low - 0.5 * abs(low or 1.0), high + 0.5 * abs(high or 1.0)
    half = found.cell_mm / 2
    extent = (
        found.x_mm[0] - half, found.x_mm[-1] + half, found.y_mm[-1] - half, found.y_mm[0] + half,
    )  # fmt: skip
    drawn = axes.imshow(
        values, vmin=low, vmax=high, extent=extent, cmap="viridis", interpolation="nearest"
    )
    axes.grid(visible=False)
    axes.set_title(title, color=INK, loc="left", pad=6)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    beyond = bool(np.any(known < low)), bool(np.any(known > high))
    ends = {(False, False): "neither", (True, False): "min", (False, True): "max"}
    canvas.colorbar(drawn, ax=axes, shrink=0.9, extend=ends.get(beyond, "both"))


def _numbers(found: SampleMap) -> str:
    rows = [_row(found, name, spread) for name in found.values if (spread := found.spread(name))]
    heads = ("Parameter", "#Median", "#Scatter", "#Explained by u", "#Beyond u", "#u shared")
    table = table_html((*heads, "#Mean curve"), rows)

    def draw(canvas: Figure) -> None:
        places = {"wspace": 0.25, **margins(canvas, 0.75, 0.15, 0.35, 0.6)}
        grid = canvas.add_gridspec(1, len(found.values), **places)
        for column, name in enumerate(found.values):
            _histogram(canvas.add_subplot(grid[0, column]), found, name)

    svg = svg_of(_HISTOGRAM_IN, draw, "histograms")
    caption = (
        "Cells by their value; the line is the fit to the mean curve of the measuring window, "
        "which on a sample that is not uniform describes no place of it."
    )
    chart = figure_html([svg], "Histograms of the cells", caption)
    explained = (
        '<p class="soft">Scatter: standard deviation over the cells. Explained by u: root mean '
        "square of what is independent from cell to cell. u shared: median of what all cells have "
        "in common, such as the white tile and the angles.</p>"
    )
    return f'<h2 id="spread">Spread over the sample</h2>\n{table}\n{explained}\n{chart}'


def _row(found: SampleMap, name: str, spread: Spread) -> str:
    unit = UNITS[name]
    shared = float(np.nanmedian(found.u_shared[name]))
    beyond = "none" if spread.uniform else _short(spread.beyond, unit)
    numbers = (spread.median, spread.scatter, spread.explained)
    cells = [*(_short(number, unit) for number in numbers), beyond, _short(shared, unit)]
    value, u = found.mean[name]
    label = _NAMES[name].removesuffix(" (°)")
    return row_html((label, *(f"#{cell}" for cell in (*cells, format_value(value, u, unit)))))


def _histogram(axes: Axes, found: SampleMap, name: str) -> None:
    known = found.values[name][np.isfinite(found.values[name])]
    low, high = np.percentile(known, (0.2, 99.8))
    mean = found.mean[name][0]
    ends = min(low, mean), max(high, mean)
    axes.hist(np.clip(known, *ends), bins=_BINS, range=ends, color="#0072B2")
    axes.axvline(mean, color="#D55E00", linewidth=1.6)
    axes.set_xlabel(_NAMES[name])
    axes.set_ylabel("cells")


def _misfit(found: SampleMap) -> str:
    rejected, fitted = int(found.rejected.sum()), int(found.fitted.sum())
    share = 100 * found.rejected_share
    text = (
        f"The model does not hold in {rejected} of {fitted} cells ({short_number(share, 3)} %): "
        "their χ² is one that chance gives to one cell of 1000, with the errors that all cells "
        "share allowed for, such as those of the angles. A cell on an edge between two surfaces "
        "may be such a place."
    )
    dof = np.maximum(np.nan_to_num(found.count) - len(found.values), 1)
    ratio = np.minimum(found.chi2 / dof, _MOST_CHI2 + 0.01)

    def draw(canvas: Figure) -> None:
        grid = canvas.add_gridspec(1, 1, **margins(canvas, 0.75, 2.6, 0.5, 0.5))
        _picture(canvas, canvas.add_subplot(grid[0]), found, ratio, "χ² / degrees of freedom")

    svg = svg_of(0.4 + _HIGH_IN, draw, "misfit")
    chart = figure_html([svg], "Misfit of each cell", "About 1 where the model holds.")
    return f'<h2 id="misfit">Places where the model does not hold</h2>\n<p>{text}</p>\n{chart}'
