"""Page of a benchmark: one self-contained HTML file, for the screen or for paper."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

from acquisition.benchmark.output.charts import main_chart, study_chart
from acquisition.benchmark.result import BenchmarkResult, MapPicture
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, pareto_front
from analysis.report.style import CSS, html_page

_MORE_CSS = """
body { max-width: 1100px; }
figcaption { color: var(--ink); font-size: 15px; }
details { margin: 6px 0 18px; }
summary { cursor: pointer; color: var(--soft); font-size: 14px; }
tr.scene td { background: var(--wash); font-weight: 600; }
"""
_GUIDE = (
    "Every chart shows cost to the right and the error against an independent truth upwards, both "
    "logarithmic: better is below and to the left. A mark is the worst error (or the root mean "
    "square, where the axis says so); the thin line reaches down to the median. The stepped grey "
    "line is the Pareto front: everything above it costs more without a smaller error. A ring and "
    "bold letters mark the program’s own choice; hollow marks are other programs, measured in the "
    "same run; dashes are limits that no method can pass."
)


def page(result: BenchmarkResult) -> str:
    """Return the page as text."""
    body = [
        _head(result),
        _figure(main_chart(result.studies), _GUIDE, ' id="main"'),
        *(_study(study) for study in result.studies),
        *(_map(n, picture) for n, picture in enumerate(result.maps, start=1)),
        _machine(result),
    ]
    return html_page("gonio bench: what accuracy costs", CSS + _MORE_CSS, body)


def _head(result: BenchmarkResult) -> str:
    facts = result.machine
    where = f"{facts.get('processor', 'unknown processor')}, {facts.get('cores', '?')} cores"
    return (
        "<header>\n<h1>What accuracy costs</h1>\n"
        f'<p class="sample">gonio bench, {escape(result.effort)} form, {result.seconds:.0f} s on '
        f"{escape(where)}; {escape(facts.get('date', ''))}</p>\n</header>"
    )


def _figure(svg: str, caption: str, attributes: str = "") -> str:
    """Return an SVG with its caption, which keeps its line breaks."""
    lines = "<br>".join(escape(line) for line in caption.splitlines())
    chart = f'<div class="chart">{svg}</div>'
    return f"<figure{attributes}>{chart}<figcaption>{lines}</figcaption></figure>"


def _study(study: Study) -> str:
    return (
        f'<h2 id="{study.name}">{escape(study.title)}</h2>\n'
        f"{_figure(study_chart(study), study.caption)}\n"
        f'<p class="soft">Truth: {escape(study.truth)}.</p>\n'
        f"<details><summary>All figures ({study.name}.csv)</summary>{_table(study)}</details>"
    )


def _map(number: int, picture: MapPicture) -> str:
    svg = picture.svg[picture.svg.index("<svg") :]  # without an XML declaration
    return (
        f'<h2 id="map_{number}">{escape(picture.title)}</h2>\n'
        f"{_figure(svg, picture.caption)}\n"
        f'<p class="soft">The numbers: map_{number}.csv.</p>'
    )


def _table(study: Study) -> str:
    with_failures = any(t.attempts for t in study.trials)
    more = list(dict.fromkeys(n for t in study.trials for n in t.more if n != "spread_of_cost"))
    head = [
        "Method", "Series", f"#{study.cost_axis}", f"#Error, {study.error_is}", "#Error, median",
        "Front", *(["#Missed"] if with_failures else []), *(f"#{n}" for n in more), "Note",
    ]  # fmt: skip
    rows = [_row(head, "th")]
    for scene in study.scenes:
        own = study.in_scene(scene)
        front = {t.label for t in pareto_front(own)}
        rows.append(f'<tr class="scene"><td colspan="{len(head)}">{escape(scene)}</td></tr>')
        rows += [_row(_cells(t, t.label in front, with_failures, more)) for t in own]
    return f'<div class="wide"><table>{"".join(rows)}</table></div>'


def _cells(trial: Trial, on_front: bool, with_failures: bool, more: Sequence[str]) -> Iterable[str]:
    yield trial.label + (" (default)" if trial.default else "")
    yield trial.series
    yield from map(_number, (trial.cost, trial.error, trial.error_median))
    yield "●" if on_front else ""
    if with_failures:
        yield f"#{trial.failures} of {trial.attempts}" if trial.attempts else ""
    yield from (_number(trial.more[name]) if name in trial.more else "#" for name in more)
    yield trial.note


def _row(cells: Iterable[str], cell: str = "td") -> str:
    """Return a table row; a cell that begins with # holds a number."""
    made = (
        f'<{cell} class="number">{escape(c[1:])}</{cell}>'
        if c.startswith("#")
        else f"<{cell}>{escape(c)}</{cell}>"
        for c in cells
    )
    return f"<tr>{''.join(made)}</tr>"


def _number(value: float) -> str:
    return f"#{value:.3g}" if math.isfinite(value) else "#no result"


def _machine(result: BenchmarkResult) -> str:
    rows = "".join(_row(fact) for fact in result.machine.items())
    peers = "".join(f"<li>{escape(line)}</li>" for line in result.peers)
    return (
        '<h2 id="machine">Machine and versions</h2>\n'
        f"<table>{rows}</table>\n"
        f'<h2 id="peers">Other programs</h2>\n<ul>{peers}</ul>'
    )
