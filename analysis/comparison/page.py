"""Page of a comparison: verdict, levels, curves over one another, differences in u, scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from analysis.comparison.agreement import DISAGREE, Test
from analysis.comparison.compared import Compared, level_text
from analysis.data.sweeps import Sweep, signed_view, sweeps
from analysis.report.figures.charts import MAX_SWEEPS, margins
from analysis.report.figures.value_axis import set_symmetric_axis
from analysis.report.style import (
    BAND,
    CSS,
    INK,
    escaped,
    figure_html,
    html_page,
    row_html,
    short_number,
    style_of,
    svg_of,
    table_html,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW_IN, _COLUMNS = 4.2, 2
_MOST_ROWS = 400  # of the table of differences


def comparison_html(compared: Compared) -> str:
    """Return the page; the same comparison gives the same text."""
    body = [_head(compared), _verdict(compared), _levels(compared), _charts(compared)]
    body += [_repeatability(compared), _differences(compared)]
    return html_page("Comparison of runs", CSS, body)


def _head(compared: Compared) -> str:
    samples = " and ".join(dict.fromkeys(escaped(s) for s in compared.samples if s))
    shown = f'<p class="sample">Sample: <b>{samples}</b></p>\n' if samples else ""
    return (
        f"<header>\n<h1>Comparison of {len(compared.names)} runs</h1>\n{shown}"
        f'<p class="soft">{compared.at.size} geometries are common to all.</p>\n</header>'
    )


def _verdict(compared: Compared) -> str:
    a = compared.agreement
    kind = "adequate" if compared.agrees else "warning"
    free = f"levels left free, {_test_text(a.shape)}"
    reason = compared.why_no_level
    told = f"With {free}. {reason[:1].upper()}{reason[1:]}"
    if not compared.shape_only:
        tile = "one white tile, whose certificate cancels"
        if not compared.same_tile:
            tile = "errors of the runs' certificates count as independent"
        told = f"{_test_text(a.whole)}; with {free}. Scale: {tile}"
    return (
        f'<section class="verdict {kind}">\n<p class="state">'
        f"{'agreement' if compared.agrees else 'difference'}</p>\n"
        f'<p class="headline">{escaped(compared.headline)}</p>\n<p>{escaped(told)}. Below a '
        f"probability of {DISAGREE:g}, runs that agree would seldom differ as much.</p>\n</section>"
    )


def _test_text(test: Test) -> str:
    return (
        f"χ² = {short_number(test.chi2, 4)} with {test.dof} degrees of freedom, probability "
        f"{short_number(test.probability, 2)}"
    )


def _levels(compared: Compared) -> str:
    if compared.shape_only:
        return ""
    rows = (
        row_html((_run(compared, k), f"#{points}", f"#{level_text(level, u)}"))
        for k, (_, _, points, level, u) in enumerate(compared.runs)
    )
    return (
        f'<h2 id="levels">Levels</h2>\n{table_html(("Run", "#Points", "#Level ± u"), rows)}\n'
        '<p class="soft">Level: relative to the first run, with all errors that the runs do not '
        "share (k = 1).</p>"
    )


def _run(compared: Compared, k: int) -> str:
    sample = f", {compared.samples[k]}" if compared.samples[k] else ""
    return escaped(f"{compared.names[k]}{sample}")


def _charts(compared: Compared) -> str:
    shown = sweeps(compared.at)[:MAX_SWEEPS]
    if not shown:
        return ""
    rows = -(-len(shown) // _COLUMNS)
    columns = min(len(shown), _COLUMNS)

    def draw(canvas: Figure) -> None:
        places = {"hspace": 0.28, "wspace": 0.22, **margins(canvas, 0.8, 0.15, 0.65, 0.6)}
        outer = canvas.add_gridspec(rows, columns, **places)
        for number, sweep in enumerate(shown):
            inner = outer[number // columns, number % columns].subgridspec(
                2, 1, height_ratios=(2, 1), hspace=0.1
            )
            upper = canvas.add_subplot(inner[0])
            lower = canvas.add_subplot(inner[1], sharex=upper)
            _panel(upper, lower, compared, sweep)
        handles, labels = canvas.axes[0].get_legend_handles_labels()
        canvas.legend(handles, labels, loc="upper left", ncols=4, frameon=False)

    quantity = "BRDF" if compared.unit else "relative BRDF"
    level = ", all on one level" if compared.shape_only else ""
    svg = svg_of(0.7 + _ROW_IN * rows, draw, "compared")
    more = len(sweeps(compared.at)) - len(shown)
    left_out = f" {more} more planes are not drawn." if more > 0 else ""
    caption = (
        f"Above: {quantity} of each run with its independent u (k = 1){level}. Below: difference "
        "to run 1 in its standard uncertainty; the band is ±2 u."
        f"{left_out} {escaped(_legend(compared))}"
    )
    chart = figure_html([svg], "BRDF of all runs, and differences", caption)
    return f'<h2 id="curves">Curves and differences</h2>\n{chart}'


def _legend(compared: Compared) -> str:
    """Names of the runs by the numbers that the chart shows; texts of a record stay out of it."""
    return "; ".join(f"run {k + 1}: {name}" for k, name in enumerate(compared.names)) + "."


def _panel(upper: Axes, lower: Axes, compared: Compared, sweep: Sweep) -> None:
    x = signed_view(compared.at)[sweep.points]
    deviations = compared.difference_in_u[:, sweep.points]
    mean = compared.brdf.mean(axis=0)[sweep.points]
    u = compared.agreement.u_scatter[sweep.points] * np.abs(mean)
    lower.axhspan(-2, 2, color=BAND, zorder=0)
    lower.axhline(0, color=INK, linewidth=0.8)
    for k, brdf in enumerate(compared.brdf[:, sweep.points]):
        colour, marker, dashes = style_of(k)
        upper.errorbar(
            x, brdf, u, color=colour, marker=marker, linestyle=dashes, markersize=4,
            linewidth=0.9, capsize=1.5, label=f"run {k + 1}",
        )  # fmt: skip
        if k:
            lower.plot(x, deviations[k], color=colour, marker=marker, linestyle="", markersize=4)
    upper.set_title(
        f"θᵢ {sweep.theta_i_deg:g}°, Δφ {sweep.dphi_deg:g}°", color=INK, loc="left", pad=6
    )
    upper.tick_params(labelbottom=False)
    low, high = (float(f(compared.brdf[:, sweep.points])) for f in (np.min, np.max))
    upper.set_ylim(min(0.0, 1.08 * low), 1.08 * max(high, 0.0) or 1.0)
    set_symmetric_axis(lower, [deviations], 3.0)
    upper.set_ylabel(f"BRDF{compared.unit}" if compared.unit else "relative BRDF")
    lower.set_ylabel("difference (u)")
    lower.set_xlabel("view angle θᵣ (°)")


def _repeatability(compared: Compared) -> str:
    scatter, expected = (100 * value for value in compared.repeatability)
    worst = int(np.argmax(compared.agreement.scatter))
    apart = "Brought to one level, the runs" if compared.shape_only else "The runs"
    return (
        '<h2 id="repeatability">Repeatability</h2>\n<p>'
        f"{apart} scatter by {short_number(scatter, 3)} % of their mean, root mean square over the "
        "geometries; noise "
        f"and other independent errors explain {short_number(expected, 3)} %. Most at "
        f"{compared.angles(worst)}: "
        f"{short_number(100 * float(compared.agreement.scatter[worst]), 3)} %.</p>"
    )


def _differences(compared: Compared) -> str:
    """Table of all geometries, up to a length that a page bears."""
    numbers = range(1, len(compared.names) + 1)
    heads = ["θᵢ (°)", "θᵣ (°)", "Δφ (°)", *(f"Run {k}{compared.unit}" for k in numbers)]
    heads += [*(f"Run {k} − 1 (u)" for k in numbers[1:]), "Scatter (%)"]
    rows = [_geometry_row(compared, n) for n in range(min(compared.at.size, _MOST_ROWS))]
    left_out = compared.at.size - len(rows)
    more = f'<p class="soft">{left_out} more are not shown.</p>' if left_out else ""
    shown = table_html((f"#{head}" for head in heads), rows)
    return f'<h2 id="geometries">Geometries</h2>\n{shown}{more}'


def _geometry_row(compared: Compared, n: int) -> str:
    at = compared.at
    cells = [f"{float(a[n]):g}" for a in (at.theta_i_deg, at.theta_r_deg, at.dphi_deg)]
    cells += [f"{value:#.4g}" for value in compared.brdf[:, n]]
    cells += [f"{value + 0.0:+.1f}" for value in np.round(compared.difference_in_u[1:, n], 1)]
    cells.append(f"{100 * float(compared.agreement.scatter[n]):#.3g}")
    return row_html("#" + cell.replace("-", "−") for cell in cells)
