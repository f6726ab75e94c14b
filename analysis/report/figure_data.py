"""Figures of a report as files: each as SVG, and what they show as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence

import numpy as np

from analysis.report.data import ReportData
from analysis.report.figure_list import budget_figure, chart_figures, drift_figure
from analysis.report.style import svg_file
from analysis.report.sweeps import PlottedSweep, group_sweeps

_ANGLES = ("theta_i_deg", "dphi_deg", "theta_r_deg")


def figure_files(data: ReportData) -> dict[str, str]:
    """Return the content of each file by its name.

    An SVG for each chart; `points.csv`: what was measured, with deviations from the model;
    `lines.csv`: lines of the models; `budget.csv`: relative u of each point by source;
    `drift.csv`: level of the lamp at each drift check. Empty without a value to plot.
    """
    sweeps = group_sweeps(data)
    figures = [*chart_figures(data, sweeps), budget_figure(data, sweeps), drift_figure(data)]
    files = {}
    for figure in (one for one in figures if one is not None):
        drawings = figure.drawings(False)
        for n, drawing in enumerate(drawings, start=1):
            number = f"-{n}" if len(drawings) > 1 else ""
            files[f"{figure.name}{number}.svg"] = svg_file(drawing)
    if data.lamp:
        files["drift.csv"] = _drift_csv(data)
    if not sweeps:
        return files
    files["points.csv"] = _points_csv(data, sweeps)
    if sweeps[0].lines:
        files["lines.csv"] = _lines_csv(data, sweeps)
    if data.sources:
        files["budget.csv"] = _budget_csv(data)
    return files


def _points_csv(data: ReportData, sweeps: Sequence[PlottedSweep]) -> str:
    """Points of all sweeps in the order of the charts."""
    value = data.measured.column
    head = (*_ANGLES, value, f"u_{value}", "deviation_percent", "u_deviation_percent", "residual_u",
            "fitted", "flags")  # fmt: skip
    rows = (
        (
            *_angles(data, i),
            _number(s.value[n]),
            _number(s.u[n]),
            _number(s.deviation[n]),
            _number(s.u_deviation[n]),
            _number(s.residual[n]),
            str(bool(s.fitted[n])).lower(),
            data.flags[i],
        )
        for s in sweeps
        for n, i in enumerate(s.at)
    )
    return _csv(head, rows)


def _lines_csv(data: ReportData, sweeps: Sequence[PlottedSweep]) -> str:
    """Lines of the models: one row for each model and place of a line."""
    rows = []
    for sweep in sweeps:
        fixed = (np.full_like(sweep.line_deg, a) for a in (sweep.series_deg, sweep.panel_deg))
        angles = sweep.axis.angles(sweep.line_deg, *fixed)
        for candidate, line in zip(data.plotted, sweep.lines, strict=True):
            for n, at in enumerate(line):
                place = (_number(float(angle[n])) for angle in angles)
                rows.append((candidate.name, *place, _number(at)))
    return _csv(("model", *_ANGLES, data.measured.column), rows)


def _budget_csv(data: ReportData) -> str:
    """Relative standard uncertainty of each point by source, in per cent."""
    rows = (
        (*_angles(data, i), *(_number(100 * part[i]) for part in data.sources.values()))
        for i in range(len(data.flags))
    )
    return _csv((*_ANGLES, *(f"u of {name} (%)" for name in data.sources)), rows)


def _drift_csv(data: ReportData) -> str:
    """Level of the lamp at each drift check, relative to the first of its setting by hand."""
    rows = (
        tuple(map(_number, (one.theta_i_deg, one.theta_r_deg, *map(float, check))))
        for one in data.lamp
        for check in zip(one.time_s, one.level, one.u, strict=True)
    )
    return _csv(("theta_i_deg", "theta_r_deg", "time_s", "level", "u_level"), rows)


def _angles(data: ReportData, i: int) -> tuple[str, ...]:
    return tuple(_number(float(getattr(data, name)[i])) for name in _ANGLES)


def _number(number: float) -> str:
    """Return a number that reads back as itself; empty where there is none."""
    return f"{number:.9g}" if math.isfinite(number) else ""


def _csv(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()
