"""HTML report of a run: one self-contained file, for the screen or for printing.

The entry point is `write_report`. Every text from the record is escaped.
"""

from __future__ import annotations

import math
from pathlib import Path

from analysis.report import captions
from analysis.report.data import ReportData, Rows
from analysis.report.figure_list import budget_figure, chart_figures, drift_figure
from analysis.report.point_texts import points_html
from analysis.report.sections.models_html import candidates_html, verdict_html
from analysis.report.sections.pictures_html import pictures_html
from analysis.report.sections.rendered_html import rendered_html
from analysis.report.style import (
    CSS,
    HOVER,
    escaped,
    format_value,
    html_page,
    row_html,
    table_html,
)
from analysis.report.sweeps import PlottedSweep, group_sweeps
from instrument.text.atomic_file import write_whole

MAP_PAGE = "map.html"
_NO_TILE = (
    "No white tile was measured, so there is no BRDF: the radiance is relative, in counts per "
    "second of this camera, lamp and lens. Only its dependence on angle is meaningful."
)


_MAP_LINK = (
    f'<p class="soft"><a href="{MAP_PAGE}">Map of the sample</a>: albedo and roughness in each '
    "place</p>"
)


def write_report(path: Path, data: ReportData) -> None:
    """Write the report atomically: `path` holds the old file or the complete new one.

    It links to the map of the sample if there is one beside it.
    """
    page = report_html(data)
    write_whole(path, with_map(page) if (path.parent / MAP_PAGE).is_file() else page)


def report_html(data: ReportData) -> str:
    """Return the report as an HTML page; the same data give the same text."""
    sweeps = group_sweeps(data)
    body = [
        _head(data, sweeps),
        verdict_html(data),
        _attention(data),
        _charts(data, sweeps),
        candidates_html(data),
        rendered_html(data.rendered),
        _flagged(data),
        _budget(data, sweeps),
        _drift(data),
        pictures_html(data.previews),
        _facts(data),
        points_html(data, sweeps) if sweeps else "",
    ]
    return html_page(escaped(data.title), CSS, body, HOVER if sweeps else "")


def with_map(page: str) -> str:
    """Return a report that links to the map of its sample, beside it; unchanged if it does."""
    return page if _MAP_LINK in page else page.replace("</header>", f"{_MAP_LINK}\n</header>", 1)


def _number(value: float | None, form: str) -> str:
    return "—" if value is None or not math.isfinite(value) else format(value, form)


def _head(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> str:
    lines = [f"<header>\n<h1>{escaped(data.title)}</h1>"]
    if data.sample:
        lines.append(f'<p class="sample">Sample: <b>{escaped(data.sample)}</b></p>')
    if data.description:
        lines.append(f'<p class="text">{escaped(data.description)}</p>')
    return "\n".join([*lines, f'<p class="soft">{captions.counts(data, sweeps)}</p>\n</header>'])


def _attention(data: ReportData) -> str:
    notes = [*data.notes, *((_NO_TILE,) if data.flags and not data.has_brdf else ())]
    if not notes:
        return ""
    items = "".join(f"<li>{escaped(note)}</li>" for note in notes)
    return f'<section id="notes" class="attention notes"><b>Notes</b><ul>{items}</ul></section>'


def _charts(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> str:
    figures = chart_figures(data, sweeps)
    if not figures:
        return '<h2 id="shape">Measured values</h2>\n<p>No geometry has a value to plot.</p>'
    return "\n".join(figure.section_html() for figure in figures)


def _flagged(data: ReportData) -> str:
    at = [i for i, flag in enumerate(data.flags) if flag]
    if not at:
        return ""
    value, u = data.value_and_u
    unit = data.measured.unit
    rows = []
    for i in at:
        angles = (data.theta_i_deg[i], data.dphi_deg[i], data.theta_r_deg[i])
        measured = format_value(float(value[i]), float(u[i]), unit)
        cells = (*(f"#{_number(a, 'g')}°" for a in angles), f"#{measured}", escaped(data.flags[i]))
        rows.append(row_html(cells))
    return (
        '<h2 id="flagged">Flagged points</h2>\n'
        '<p class="soft">Marked with a cross; outliers may lie outside a chart.</p>\n'
        + table_html(("#θᵢ", "#Δφ", "#θᵣ", "#Value ± u (k = 1)", "Flag"), rows)
    )


def _budget(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> str:
    if not data.budget:
        return ""
    rows = (
        row_html((escaped(name), f"#{_percent(u)}", f"#{_number(share, '.0f')} %", _bar(share)))
        for name, u, share in data.budget
    )
    figure = budget_figure(data, sweeps)
    return (
        '<h2 id="budget">Uncertainty budget</h2>\n'
        '<p class="soft">Standard uncertainty (k = 1) of a point, relative to its value.</p>\n'
        + (figure.html() if figure else "")
        + table_html(("Source", "#Relative u, median", "#Share of variance", ""), rows)
    )


def _drift(data: ReportData) -> str:
    figure = drift_figure(data)
    return figure.section_html() if figure else ""


def _percent(value: float) -> str:
    return "< 0.0001 %" if 0 < value < 1e-4 else f"{_number(value, '.2g')} %"


def _bar(share: float) -> str:
    width = min(max(share, 0.0), 100.0) if math.isfinite(share) else 0.0
    return (
        '<svg class="share" viewBox="0 0 100 6" preserveAspectRatio="none">'
        '<rect width="100" height="6" fill="#eee"/>'
        f'<rect width="{width:.1f}" height="6" fill="#555"/></svg>'
    )


def _facts(data: ReportData) -> str:
    tables = (
        ("metadata", "Sample and light", data.metadata),
        ("rig", "Rig", data.rig),
        ("devices", "Devices", data.devices),
        ("calibrations", "Calibrations", data.calibrations),
        ("files", "Files", data.files),
        ("times", "Times", data.times),
        ("versions", "Versions", data.versions),
    )
    found = "".join(_fact(*table) for table in tables if table[2])
    title = '<h2 id="facts">Measurement conditions</h2>'
    return f'{title}\n<div class="facts">{found}</div>' if found else ""


def _fact(name: str, title: str, rows: Rows) -> str:
    body = "".join(row_html((escaped(label), escaped(value))) for label, value in rows)
    return f'<section id="{name}"><h3>{title}</h3><table><tbody>{body}</tbody></table></section>'
