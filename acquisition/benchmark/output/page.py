"""The page of a bench: one HTML file that needs nothing else, to read on screen or on paper."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable

from acquisition.benchmark.output.charts import main_chart, study_chart
from acquisition.benchmark.result import Bench, MapPicture
from acquisition.benchmark.study import Study
from acquisition.benchmark.trial import Trial, pareto_front
from analysis.report.style import CSS

_MORE_CSS = """
body { max-width: 1100px; }
figcaption { color: var(--ink); font-size: 15px; }
details { margin: 6px 0 18px; }
summary { cursor: pointer; color: var(--soft); font-size: 14px; }
td.default { font-weight: 700; }
tr.scene td { background: var(--wash); font-weight: 600; }
"""
_HOW = (
    "Every chart has cost to the right and the error against an independent truth upwards, both "
    "logarithmic: better is below and to the left. A mark is the worst error (or the root mean "
    "square, where the axis says so); the thin line reaches down to the median. The stepped grey "
    "line is the Pareto front: what lies above it costs more for no less error. A ring and bold "
    "letters are what the program does by itself; hollow marks are other programs, measured in "
    "the same run; dashes are limits that no method can pass."
)


def page(bench: Bench) -> str:
    """The page as text."""
    body = [
        _head(bench),
        f'<figure id="main">{main_chart(bench.studies)}<figcaption>{_text(_HOW)}</figcaption>'
        "</figure>",
        *(_study(study) for study in bench.studies),
        *(_map(n, picture) for n, picture in enumerate(bench.maps, start=1)),
        _facts(bench),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>gonio bench: what accuracy costs</title>\n<style>{CSS}{_MORE_CSS}</style>\n"
        "</head>\n<body>\n" + "\n".join(body) + "\n</body>\n</html>\n"
    )


def _text(words: str) -> str:
    return html.escape(words)


def _head(bench: Bench) -> str:
    facts = bench.machine
    where = f"{facts.get('processor', 'unknown processor')}, {facts.get('cores', '?')} cores"
    return (
        "<header>\n<h1>What accuracy costs</h1>\n"
        f'<p class="sample">gonio bench, {_text(bench.effort)} form, {bench.seconds:.0f} s on '
        f"{_text(where)}; {_text(facts.get('date', ''))}</p>\n</header>"
    )


def _study(study: Study) -> str:
    lines = "<br>".join(_text(line) for line in study.caption.splitlines())
    return (
        f'<h2 id="{study.name}">{_text(study.title)}</h2>\n'
        f"<figure>{study_chart(study)}<figcaption>{lines}</figcaption></figure>\n"
        f'<p class="soft">Truth: {_text(study.truth)}.</p>\n'
        f"<details><summary>All figures ({study.name}.csv)</summary>{_table(study)}</details>"
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
        front = {t.label for t in pareto_front(study.of(scene))}
        rows.append(f'<tr class="scene"><td colspan="{len(head)}">{_text(scene)}</td></tr>')
        rows += [_trial(t, t.label in front, with_failures, more) for t in study.of(scene)]
    return f'<div class="wide"><table>{"".join(rows)}</table></div>'


def _trial(trial: Trial, on_front: bool, with_failures: bool, more: list[str]) -> str:
    cells = [
        trial.label + (" (default)" if trial.default else ""),
        trial.series,
        "#" + _number(trial.cost),
        "#" + _number(trial.error),
        "#" + _number(trial.error_median),
        "●" if on_front else "",
    ]
    if with_failures:
        cells.append(f"#{trial.failures} of {trial.attempts}" if trial.attempts else "")
    cells += ["#" + (_number(trial.more[n]) if n in trial.more else "") for n in more]
    return _row([*cells, trial.note])


def _row(cells: Iterable[str], cell: str = "td") -> str:
    """A table row; a cell that begins with # holds a number."""
    made = (
        f'<{cell} class="number">{_text(c[1:])}</{cell}>'
        if c.startswith("#")
        else f"<{cell}>{_text(c)}</{cell}>"
        for c in cells
    )
    return f"<tr>{''.join(made)}</tr>"


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "no result"


def _map(number: int, picture: MapPicture) -> str:
    lines = "<br>".join(_text(line) for line in picture.caption.splitlines())
    svg = re.sub(r"^.*?(?=<svg)", "", picture.svg, count=1, flags=re.DOTALL)
    return (
        f'<h2 id="map_{number}">{_text(picture.title)}</h2>\n'
        f"<figure>{svg}<figcaption>{lines}</figcaption></figure>\n"
        f'<p class="soft">The numbers: map_{number}.csv.</p>'
    )


def _facts(bench: Bench) -> str:
    rows = "".join(_row(fact) for fact in bench.machine.items())
    peers = "".join(f"<li>{_text(line)}</li>" for line in bench.peers)
    return (
        '<h2 id="machine">Machine and versions</h2>\n'
        f"<table>{rows}</table>\n"
        f'<h2 id="peers">Other programs</h2>\n<ul>{peers}</ul>'
    )
