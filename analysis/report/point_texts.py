"""Values of each point in words, which the page shows beside the pointer."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

from analysis.report.data import ReportData
from analysis.report.style import format_value, short_number, visible
from analysis.report.sweeps import PlottedSweep

PLACE = "points"
"""Id of the element that holds the texts."""


def points_html(data: ReportData, sweeps: Sequence[PlottedSweep]) -> str:
    """Return the texts of all points as a block of data, which no browser runs."""
    texts = json.dumps(point_texts(data, sweeps), ensure_ascii=False, separators=(",", ":"))
    # In a script element only these can end it (WHATWG HTML, 4.12.1.3).
    texts = texts.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    return f'<script type="application/json" id="{PLACE}">{texts}</script>'


def point_texts(data: ReportData, sweeps: Sequence[PlottedSweep]) -> list[str]:
    """Return one text (N,) for each point of the run, empty for a point that is in no chart."""
    texts = [""] * len(data.flags)
    value, u = data.value_and_u
    name, unit = data.measured.title, data.measured.unit
    for sweep in sweeps:
        for n, i in enumerate(sweep.at):
            angles = (("θᵢ", data.theta_i_deg), ("θᵣ", data.theta_r_deg), ("Δφ", data.dphi_deg))
            place = ", ".join(f"{symbol} {_degrees(column[i])}" for symbol, column in angles)
            measured = f"{name} {format_value(float(value[i]), float(u[i]), unit)}"
            why = f"measured for: {data.chosen_for[i]}" if data.chosen_for else ""
            lines = [place, measured, _difference(sweep, n), visible(data.flags[i]), visible(why)]
            texts[i] = "\n".join(line for line in lines if line)
    return texts


def _degrees(angle_deg: float) -> str:
    return f"{angle_deg:.4g}°".replace("-", "−")


def _difference(sweep: PlottedSweep, n: int) -> str:
    """Difference of a point from the line of the model, in per cent and in u, where known."""
    parts = []
    if math.isfinite(sweep.deviation[n]):
        parts.append(f"{_signed(sweep.deviation[n])} % of the line")
    if math.isfinite(sweep.residual[n]):
        parts.append(f"residual {_signed(sweep.residual[n])} u")
    return ", ".join(parts)


def _signed(number: float) -> str:
    return ("−" if number < 0 else "+") + short_number(abs(number), 2)
