"""Page of a map: what the sample is like, a picture of each parameter and its u, and histograms."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from analysis.report.figures.charts import margins
from analysis.report.style import (
    CSS,
    NARROW_IN,
    Drawing,
    embedded_svg,
    escaped,
    figure_html,
    format_value,
    html_page,
    row_html,
    short_number,
    svg_of,
    table_html,
)
from analysis.sample_maps.pictures import Panel, maps_html, screen_colours
from analysis.sample_maps.sample_map import UNITS, SampleMap
from analysis.sample_maps.spread import Spread
from instrument.devices import CHANNELS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Of the cells, whose values the colours span; u rises where fewer views show a cell, at the edges.
_SHOWN_PERCENT, _SHOWN_U_PERCENT = (1.0, 99.0), (1.0, 94.0)
_BINS = 80
_HISTOGRAM_IN = 2.8
_NAMES = {
    "albedo": "albedo",
    "sigma_deg": "σ (°)",
    "ks": "kₛ",
    **{
        f"{name}_{channel}": f"{label}, {colour}"
        for name, label in (("albedo", "albedo"), ("ks", "kₛ"))
        for channel, colour in zip(CHANNELS, ("red", "green", "blue"), strict=True)
    },
}
_MOST_ACROSS = 3  # histograms
_MOST_CHI2 = 3.0  # of the colours of chi2 over its expectation


def map_html(found: SampleMap, report: str | None = None) -> str:
    """Return the page; the same map gives the same text. report: page of its run, beside it."""
    body = [
        _head(found, report),
        _verdict(found),
        _pictures(found),
        _numbers(found),
        _misfit(found),
    ]
    return html_page(f"Map of {found.sample}", CSS, body)


def _head(found: SampleMap, report: str | None) -> str:
    rows, columns = found.chi2.shape
    link = f'<p class="soft"><a href="{report}">Report of the run</a></p>\n' if report else ""
    return (
        f"<header>\n<h1>Map of the sample: {escaped(found.title)}</h1>\n"
        f'<p class="sample">Sample: <b>{escaped(found.sample)}</b></p>\n'
        f'<p class="soft">{columns} × {rows} cells of {found.cell_mm:g} mm; {found.model} fitted '
        f"in each, at up to {found.geometries} geometries.</p>\n{link}</header>"
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
    panels = []
    for name in found.values:
        panels.append(Panel(_NAMES[name], found.values[name], _SHOWN_PERCENT))
        panels.append(Panel(f"u of {_NAMES[name]}", found.u(name), _SHOWN_U_PERCENT))
    caption = (
        "Each cell's value, and its standard uncertainty (k = 1) with what all cells share. Places "
        "are seen along the normal and count from the rotation axis; at Δφ = 0° the lamp is at +x. "
        "The colours span nearly all cells; a pointed end of their bar holds the rest. White: no "
        "fit."
    )
    drawn = maps_html(found, panels, "Maps of the sample", caption)
    return f'<h2 id="maps">Maps</h2>\n{_in_colour(found)}{drawn}'


def _in_colour(found: SampleMap) -> str:
    """Return the picture of the albedo in colour; nothing for a camera of one channel."""
    if found.colour is None:
        return ""
    panel = Panel("colour of the sample", screen_colours(found.colour), _SHOWN_PERCENT)
    caption = (
        "Albedo of each cell in the red, green and blue channel of the camera, as those of a "
        "screen (sRGB): a white tile would be white. Light and angles are taken out. The channels "
        "of a camera are not those of the eye; an albedo above 1 is drawn as 1, and cells without "
        "a fit are left open."
    )
    return maps_html(found, [panel], "Albedo in colour", caption)


def _numbers(found: SampleMap) -> str:
    rows = [_row(found, name, spread) for name in found.values if (spread := found.spread(name))]
    heads = ("Parameter", "#Median", "#Scatter", "#Explained by u", "#Beyond u", "#u shared")
    table, count = table_html((*heads, "#Mean curve"), rows), len(found.values)

    def draw(canvas: Figure, columns: int) -> None:
        rows = -(-count // columns)
        places = {"wspace": 0.25, "hspace": 0.35, **margins(canvas, 0.75, 0.15, 0.35, 0.6)}
        grid = canvas.add_gridspec(rows, columns, **places)
        for number, name in enumerate(found.values):
            _histogram(canvas.add_subplot(grid[divmod(number, columns)]), found, name)

    across = -(-count // -(-count // _MOST_ACROSS))
    height_in = -(-count // across) * _HISTOGRAM_IN
    wide = svg_of(height_in, partial(draw, columns=across), "histograms")
    tall = Drawing(count * _HISTOGRAM_IN, partial(draw, columns=1), NARROW_IN)
    narrow = embedded_svg(tall, "narrow-histograms")
    caption = (
        "Cells by their value; the line is the fit to the mean curve of the measuring window, "
        "which on a sample that is not uniform describes no place of it."
    )
    chart = figure_html([wide], "Histograms of the cells", caption, [narrow])
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
    axes.locator_params(axis="x", nbins=5)


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
    panel = Panel("χ² / degrees of freedom", ratio, _SHOWN_PERCENT)
    caption = "About 1 where the model holds."
    chart = maps_html(found, [panel], "Misfit of each cell", caption)
    return f'<h2 id="misfit">Places where the model does not hold</h2>\n<p>{text}</p>\n{chart}'
