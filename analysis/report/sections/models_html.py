"""Models of a report: the verdict with its parameters, and the table of the candidates."""

from __future__ import annotations

import math
import re

from analysis.report.data import Candidate, Parameter, ReportData
from analysis.report.style import (
    escaped,
    format_value,
    interval_text,
    row_html,
    short_number,
    table_html,
)

_COVERAGE = 1.96  # of u: 95 % of a normal distribution
_WITHIN_U = 4.0  # reduced chi2 beyond which a model that passes does so with a larger u than stated
_STATES = {
    "adequate": ("adequate", "✔ Adequate: the model explains the data"),
    "none adequate": ("warning", "✘ No model explains the data within their uncertainty"),
    "not identifiable": ("warning", "? The data do not determine every parameter"),
}


def verdict_html(data: ReportData) -> str:
    """Return the verdict in a box, with the parameters of the chosen model."""
    kind, state = _STATES.get(data.verdict_kind, ("", ""))
    headline, *more = data.verdict or ("No model was fitted.",)
    values = [
        f"<div><dt>{_name(p.name)}</dt><dd>{_value_of(p)}</dd>{_interval_html(p)}</div>"
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


def _parameter_html(parameter: Parameter) -> str:
    name = f'<span class="name">{escaped(parameter.name)}</span>'
    kind = "parameter" if parameter.u is not None else "parameter open"
    return f'<span class="{kind}">{name} {_value_of(parameter)}</span>'


def _value_of(parameter: Parameter) -> str:
    if parameter.u is None and parameter.interval is not None:
        low, high = (short_number(end, 4) for end in parameter.interval)
        return escaped(f"not determined, in [{low}, {high}]{_unit_of(parameter)}")
    return escaped(format_value(parameter.value, parameter.u, parameter.unit))


def _interval_html(parameter: Parameter) -> str:
    """Interval that holds the value with a probability of 95 %, below a value with its u."""
    if parameter.u is None or not math.isfinite(parameter.u) or parameter.u <= 0:
        return ""
    half = _COVERAGE * parameter.u
    low, high = interval_text(parameter.value - half, parameter.value + half)
    text = f"{low} to {high}{_unit_of(parameter)}"
    return f'<dd class="interval">95 %: {escaped(text)}</dd>'


def _unit_of(parameter: Parameter) -> str:
    """Unit as it follows a number, empty without one."""
    return f"\u00a0{parameter.unit}" if parameter.unit else ""


def candidates_html(data: ReportData) -> str:
    """Return the table of all fitted models; empty without one."""
    if not data.candidates:
        return ""
    known = [c.bic for c in data.candidates if c.bic is not None and math.isfinite(c.bic)]
    best = min(known, default=None)
    chosen = next((c for c in data.candidates if c.chosen), None)
    head = ("Model", "Parameters ± u (k = 1)", "#Residual, rms", "#Reduced χ²", "#ΔBIC")
    tag = "✔ chosen" if data.verdict_kind == "adequate" else "best candidate"
    rows = (_candidate(c, best, tag, chosen) for c in data.ranked)
    table = table_html(head, rows, "wide candidates")
    return (
        f'<h2 id="candidates">Models compared</h2>\n{table}\n'
        '<p class="soft">Residual: relative to the mean. Reduced χ² near 1: the model agrees with '
        "the data within their uncertainty. ΔBIC: difference from the lowest BIC, which includes a "
        "penalty for each parameter. Brackets: 95 % interval. Models that are not chosen are shown "
        "with the values that fit best, and with u where they agree with the data.</p>"
    )


def _why_not(candidate: Candidate, chosen: Candidate | None) -> str:
    """Return why a model is not the chosen one, empty for that."""
    if not candidate.converged:
        return f"did not converge: {candidate.message}"
    if not candidate.agrees:
        return f"does not fit: {_misfit(candidate.reduced_chi2)}"
    if candidate.chosen or chosen is None:
        return ""
    chi2 = candidate.reduced_chi2
    if chi2 is not None and chi2 > _WITHIN_U:
        return f"fits only with {math.sqrt(chi2):.2g} times the stated u"
    more = _free(candidate) - _free(chosen)
    if more > 0:
        return f"fits, but has {more} parameter{'s' * (more > 1)} more than needed"
    return "fits, but less well with as many parameters" if more == 0 else "fits less well"


def _misfit(chi2: float | None) -> str:
    """Return what is wrong with the residuals of a model that does not agree."""
    if chi2 is None or not math.isfinite(chi2):
        return "residuals too large"
    if chi2 > _WITHIN_U:
        return f"residuals about {float(f'{math.sqrt(chi2):.2g}'):g} times u"
    # Chi2 alone is rejected above 1 only; below, the runs test has rejected.
    return "residuals with a pattern" if chi2 <= 1 else "residuals larger than u, or with a pattern"


def _free(candidate: Candidate) -> int:
    """Number of parameters; a ratio of two of them is none."""
    return sum("/" not in p.name for p in candidate.parameters)


def _candidate(
    candidate: Candidate, best_bic: float | None, tag: str, chosen: Candidate | None
) -> str:
    above = math.nan
    if candidate.bic is not None and best_bic is not None:
        above = candidate.bic - best_bic
    note = f'<br><span class="tag">{tag}</span>' if candidate.chosen else ""
    if why := _why_not(candidate, chosen):
        note += f'<br><span class="soft">{escaped(why)}</span>'
    parameters = "".join(map(_parameter_html, candidate.parameters))
    rms = candidate.rms_relative
    cells = (
        _name(candidate.name) + note,
        parameters,
        "#" + (f"{short_number(100 * rms, 3)} %" if math.isfinite(rms) else "—"),
        "#" + short_number(candidate.reduced_chi2, 3),
        "#" + (f"{above:.1f}" if abs(above) < 1000 else short_number(above, 3)),
    )
    return row_html(cells, "chosen" if candidate.chosen else "")
