"""HTML report of a run: one self-contained file, for the screen or for printing.

The entry point is `write_report`. Every text from the record is escaped.
"""

from __future__ import annotations

import base64
import math
import re
import struct
from pathlib import Path

from analysis.report import captions, charts
from analysis.report.budget_chart import budget_chart, with_budget
from analysis.report.data import Candidate, Parameter, ReportData, Rows
from analysis.report.polar import polar_chart
from analysis.report.style import (
    CSS,
    escaped,
    figure_html,
    format_value,
    html_page,
    row_html,
    short_number,
    table_html,
)
from analysis.report.sweeps import PlottedSweep, group_sweeps
from analysis.report.swept_axis import VIEW
from instrument.record.reading import Preview
from instrument.text.atomic_file import write_whole

_STATES = {
    "adequate": ("adequate", "✔ Adequate: the model explains the data"),
    "none adequate": ("warning", "✘ No model explains the data within their uncertainty"),
    "not identifiable": ("warning", "? The data do not determine every parameter"),
}
_NO_TILE = (
    "No white tile was measured, so there is no BRDF: the radiance is relative, in counts per "
    "second of this camera, lamp and lens. Only its dependence on angle is meaningful."
)
_PNG_HEADER = struct.Struct(">8s4x4sII")


def write_report(path: Path, data: ReportData) -> None:
    """Write the report atomically: `path` holds the old file or the complete new one."""
    write_whole(path, report_html(data))


def report_html(data: ReportData) -> str:
    """Return the report as an HTML page; the same data give the same text."""
    sweeps = group_sweeps(data)
    body = [
        _head(data, sweeps),
        _verdict(data),
        _attention(data),
        _charts(data, sweeps),
        _candidates(data),
        _flagged(data),
        _budget(data, sweeps),
        _pictures(data.previews),
        _facts(data),
    ]
    return html_page(escaped(data.title), CSS, body)


def _number(value: float | None, form: str) -> str:
    return "—" if value is None or not math.isfinite(value) else format(value, form)


def _head(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> str:
    lines = [f"<header>\n<h1>{escaped(data.title)}</h1>"]
    if data.sample:
        lines.append(f'<p class="sample">Sample: <b>{escaped(data.sample)}</b></p>')
    if data.description:
        lines.append(f'<p class="text">{escaped(data.description)}</p>')
    return "\n".join([*lines, f'<p class="soft">{captions.counts(data, sweeps)}</p>\n</header>'])


def _verdict(data: ReportData) -> str:
    kind, state = _STATES.get(data.verdict_kind, ("", ""))
    headline, *more = data.verdict or ("No model was fitted.",)
    values = [
        f"<div><dt>{_name(p.name)}</dt><dd>{_value_of(p)}</dd></div>"
        for candidate in data.candidates
        for p in candidate.parameters
        if candidate.chosen
    ]
    return "\n".join(
        [
            f'<section id="verdict" class="verdict {kind}">',
            f'<div class="state">{state}</div>' if state else "",
            f'<p class="headline">{_name(headline, "+/_")}</p>',
            *(f"<p>{escaped(sentence)}</p>" for sentence in more),
            f'<dl class="values">{"".join(values)}</dl>' if values else "",
            "</section>",
        ]
    )


def _name(raw: str, joints: str = "+/") -> str:
    """Escape a text with names of models or parameters, which may wrap after the joints."""
    return re.sub(rf"(?<=\w)[{joints}](?=\w)", r"\g<0><wbr>", escaped(raw))


def _value_of(parameter: Parameter) -> str:
    if parameter.u is None and parameter.interval is not None:
        low, high = (short_number(end, 4) for end in parameter.interval)
        unit = f"\u00a0{parameter.unit}" if parameter.unit else ""
        return escaped(f"not determined, in [{low}, {high}]{unit}")
    return escaped(format_value(parameter.value, parameter.u, parameter.unit))


def _attention(data: ReportData) -> str:
    notes = [*data.notes, *((_NO_TILE,) if data.flags and not data.has_brdf else ())]
    if not notes:
        return ""
    items = "".join(f"<li>{escaped(note)}</li>" for note in notes)
    return f'<section id="notes" class="attention notes"><b>Notes</b><ul>{items}</ul></section>'


def _charts(data: ReportData, sweeps: tuple[PlottedSweep, ...]) -> str:
    if not sweeps:
        return '<h2 id="shape">Measured values</h2>\n<p>No geometry has a value to plot.</p>'
    name = "BRDF" if data.has_brdf else "Radiance"
    quantity = data.quantity
    figures = [
        '<h2 id="shape">Shape of the reflection</h2>',
        figure_html(
            charts.shape_charts(sweeps, quantity),
            f"shape against the {sweeps[0].axis.name}",
            captions.shape_caption(data, sweeps, quantity),
        ),
        f'<h2 id="brdf">{captions.brdf_title(sweeps, name)}</h2>',
        figure_html(
            [charts.brdf_chart(sweeps, quantity)], quantity, captions.panel_caption(data, sweeps)
        ),
    ]
    if sweeps[0].axis is VIEW:
        polar = [polar_chart(sweeps, quantity)]
        caption = captions.polar_caption(data, sweeps, quantity)
        figures.append(f'<h2 id="polar">{name} around the sample</h2>')
        figures.append(figure_html(polar, f"{quantity}, polar", caption))
    return "\n".join(figures)


def _candidates(data: ReportData) -> str:
    if not data.candidates:
        return ""
    known = [c.bic for c in data.candidates if c.bic is not None and math.isfinite(c.bic)]
    best = min(known, default=None)
    head = ("Model", "Parameters ± u (k = 1)", "#Residual, rms", "#Reduced χ²", "#ΔBIC")
    tag = "✔ chosen" if data.verdict_kind == "adequate" else "best candidate"
    table = table_html(head, (_candidate(c, best, tag) for c in data.ranked), "wide candidates")
    return (
        f'<h2 id="candidates">Models compared</h2>\n{table}\n'
        '<p class="soft">Residual: relative to the mean. Reduced χ² near 1: the model agrees with '
        "the data within their uncertainty. ΔBIC: difference from the lowest BIC, which includes a "
        "penalty for each parameter. Brackets: 95 % interval. Models that are not chosen are shown "
        "with the values that fit best, and with u where they agree with the data.</p>"
    )


def _candidate(candidate: Candidate, best_bic: float | None, tag: str) -> str:
    above = math.nan
    if candidate.bic is not None and best_bic is not None:
        above = candidate.bic - best_bic
    note = f'<br><span class="tag">{tag}</span>' if candidate.chosen else ""
    if not candidate.converged:
        note += f'<br><span class="soft">did not converge: {escaped(candidate.message)}</span>'
    elif not candidate.agrees:
        note += '<br><span class="soft">does not fit</span>'
    parameters = "".join(
        f'<span class="parameter"><span class="name">{escaped(p.name)}</span> {_value_of(p)}</span>'
        for p in candidate.parameters
    )
    rms = candidate.rms_relative
    cells = (
        _name(candidate.name) + note,
        parameters,
        "#" + (f"{short_number(100 * rms, 3)} %" if math.isfinite(rms) else "—"),
        "#" + short_number(candidate.reduced_chi2, 3),
        "#" + (_number(above, ".1f") if abs(above) < 1000 else short_number(above, 3)),
    )
    return row_html(cells, "chosen" if candidate.chosen else "")


def _flagged(data: ReportData) -> str:
    at = [i for i, flag in enumerate(data.flags) if flag]
    if not at:
        return ""
    value, u = data.value_and_u
    unit = "1/sr" if data.has_brdf else "counts/s"
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
    drawn, known = "", with_budget(data, sweeps)
    if known:
        label, caption = "uncertainty by source", captions.budget_caption(known)
        drawn = figure_html([budget_chart(data, known)], label, caption)
    return (
        '<h2 id="budget">Uncertainty budget</h2>\n'
        '<p class="soft">Standard uncertainty (k = 1) of a point, relative to its value.</p>\n'
        + drawn
        + table_html(("Source", "#Relative u, median", "#Share of variance", ""), rows)
    )


def _percent(value: float) -> str:
    return "< 0.0001 %" if 0 < value < 1e-4 else f"{_number(value, '.2g')} %"


def _bar(share: float) -> str:
    width = min(max(share, 0.0), 100.0) if math.isfinite(share) else 0.0
    return (
        '<svg class="share" viewBox="0 0 100 6" preserveAspectRatio="none">'
        '<rect width="100" height="6" fill="#eee"/>'
        f'<rect width="{width:.1f}" height="6" fill="#555"/></svg>'
    )


def _pictures(previews: tuple[Preview, ...]) -> str:
    if not previews:
        return ""
    return (
        '<h2 id="pictures">Camera pictures</h2>\n'
        '<p class="soft">Outline: the window of averaged pixels, which shows the same area of the '
        'sample at every angle.</p>\n<div class="pictures">'
        + "".join(map(_picture, previews))
        + "</div>"
    )


def _picture(preview: Preview) -> str:
    caption = f"<figcaption>{escaped(preview.caption)}</figcaption>"
    size = _png_size(preview.png)
    if size is None:
        return f"<figure><p>This picture cannot be read.</p>{caption}</figure>"
    # Whole numbers are the centres of pixels in the record, and their edges in SVG.
    corners = " ".join(
        f"{x + 0.5:.2f},{y + 0.5:.2f}"
        for x, y in preview.polygon
        if math.isfinite(x) and math.isfinite(y)
    )
    outline = f'<polygon points="{corners}" fill="none" vector-effect="non-scaling-stroke"'
    png = base64.b64encode(preview.png).decode("ascii")
    return (
        f'<figure><svg viewBox="0 0 {size[0]} {size[1]}" role="img" aria-label="camera picture">'
        f'<image width="{size[0]}" height="{size[1]}" href="data:image/png;base64,{png}"/>'
        f'{outline} stroke="#000" stroke-width="4"/>{outline} stroke="#fff" stroke-width="1.8"/>'
        f"</svg>{caption}</figure>"
    )


def _png_size(png: bytes) -> tuple[int, int] | None:
    """Width and height in pixels from the header of a PNG; None for other data."""
    if len(png) < _PNG_HEADER.size:
        return None
    signature, chunk, width, height = _PNG_HEADER.unpack_from(png)
    known = signature == b"\x89PNG\r\n\x1a\n" and chunk == b"IHDR" and width and height
    return (width, height) if known else None


def _facts(data: ReportData) -> str:
    tables = (
        ("metadata", "Sample and light", data.metadata),
        ("rig", "Rig", data.rig),
        ("devices", "Devices", data.devices),
        ("times", "Times", data.times),
        ("versions", "Versions", data.versions),
    )
    found = "".join(_fact(*table) for table in tables if table[2])
    title = '<h2 id="facts">Measurement conditions</h2>'
    return f'{title}\n<div class="facts">{found}</div>' if found else ""


def _fact(name: str, title: str, rows: Rows) -> str:
    body = "".join(row_html((escaped(label), escaped(value))) for label, value in rows)
    return f'<section id="{name}"><h3>{title}</h3><table><tbody>{body}</tbody></table></section>'
