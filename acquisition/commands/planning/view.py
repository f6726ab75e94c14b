"""Terminal view of an optimal plan, and the same for JSON."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from acquisition.design.forecast import UNDETERMINED
from acquisition.design.optimal_plan import OptimalPlan, Planned
from acquisition.terminal.console import duration_text, out, print_lines, print_notes, print_text
from acquisition.terminal.layout import table_lines
from analysis.design.rivals import TOLD_APART
from analysis.models import Parameter

UNITS = {"1": "", "degrees": "°"}
"""Units of parameters as people write them."""

_HEADER = ("geometry", "theta_i (deg)", "dphi (deg)", "theta_r (deg)", "for")
_SOURCES = 3  # of the error of a parameter that a note names


def print_optimal(found: OptimalPlan) -> None:
    """Print the geometries and what each is for, the u that they will give, and notes."""
    count = len(found.reasons)
    print_text(
        f"{found.chosen.loaded.protocol.name}: {count} of {found.candidates} geometries, for "
        f"{', '.join(found.asked)}; about {duration_text(found.chosen.plan.duration_s)}"
    )
    print_text(f"sample: {found.sample.text}")
    print_lines(["", *table_lines(_HEADER, list(_geometry_rows(found)), out.width), ""])
    header = ("u (k = 1)", "these", "even sweeps, about the same time", "sweeps of the protocol")
    print_lines([*table_lines(header, list(_u_rows(found)), out.width), ""])
    print_notes(list(_notes(found)))


def _geometry_rows(found: OptimalPlan) -> Iterator[tuple[str, ...]]:
    for number, (step, reason) in enumerate(
        zip(found.chosen.plan.points, found.reasons, strict=True), start=1
    ):
        angles = (f"{a:g}" for a in (step.pose.theta_i, step.pose.dphi, step.pose.theta_r))
        yield str(number), *angles, reason


def _compared(found: OptimalPlan) -> tuple[Planned | None, ...]:
    return found.chosen, found.same_time, found.sweeps


def _u_rows(found: OptimalPlan) -> Iterator[tuple[str, ...]]:
    plans = _compared(found)
    yield "geometries", *("-" if p is None else str(len(p.plan.points)) for p in plans)
    yield "minutes", *("-" if p is None else f"{p.minutes:.1f}" for p in plans)
    for parameter in found.sample.model.parameters:
        if parameter.name in found.chosen.u:
            yield parameter.name, *("-" if p is None else _u_text(p, parameter) for p in plans)


def _u_text(planned: Planned, parameter: Parameter) -> str:
    u = planned.u[parameter.name]
    if u > UNDETERMINED * (parameter.high - parameter.low):
        return "not determined"
    return f"{u:.2g} {UNITS.get(parameter.unit, parameter.unit)}".rstrip()


def _notes(found: OptimalPlan) -> Iterator[str]:
    if not found.between:
        yield (
            f"candidates are {found.candidates} of the protocol's own geometries: it has too many "
            "for others, or the way to those between its views is not clear"
        )
    if found.same_time is None:
        yield (
            "no even sweeps of this time: two views at each setting of the lamp take more, or a "
            "keep-out zone bars the way"
        )
    if found.goal is not None:
        yield f"as few as reach {found.goal.text}: one geometry fewer would not"
    for name, sources in found.sources.items():
        parts = ", ".join(f"{100 * p:.0f} % {s}" for s, p in list(sources.items())[:_SOURCES])
        yield f"variance of {name}: {parts}"
    together = " together" if len(found.asked) > 1 else ""
    yield (
        f"no other {len(found.reasons)} of the candidates, repeated or not, can have less than "
        f"{100 * found.efficiency:.0f} % of the u of {', '.join(found.asked)}{together}"
    )
    told = {name: chi2 for name, chi2 in found.rivals.items() if chi2 >= TOLD_APART}
    if told:
        yield (
            f"told apart from {', '.join(told)}: the best fit of each will miss the values by a "
            f"chi2 of {min(told.values()):.3g} or more"
        )
    for name in found.rivals.keys() - told.keys():
        yield (
            f"not surely told apart from {name}, whose best fit will miss the values by a chi2 of "
            f"{found.rivals[name]:.3g} only: plan more geometries, or other incidences"
        )
    yield (
        "forecast for a sample like the named one, with the texture of the protocol's "
        "simulated_sample, or a usual one: the u of a run may be a third larger"
    )


def optimal_json(found: OptimalPlan) -> dict[str, Any]:
    """Return the plan as plain values for JSON; times in seconds, angles in degrees."""
    parameters = (p.name for p in found.sample.model.parameters)
    return {
        "sample": {
            "model": found.sample.model.name,
            "parameters": dict(zip(parameters, found.sample.x.tolist(), strict=True)),
        },
        "for": list(found.asked),
        "until": found.goal and dict(found.goal.u),
        "candidates": found.candidates,
        "geometries": [
            {
                "theta_i_deg": step.pose.theta_i,
                "dphi_deg": step.pose.dphi,
                "theta_r_deg": step.pose.theta_r,
                "for": reason,
            }
            for step, reason in zip(found.chosen.plan.points, found.reasons, strict=True)
        ],
        "optimal": _planned_json(found.chosen),
        "even_sweeps_same_time": found.same_time and _planned_json(found.same_time),
        "sweeps": _planned_json(found.sweeps),
        "parts_of_variance": found.sources,
        "least_part_of_u": found.efficiency,
        "other_models_chi2": found.rivals,
    }


def _planned_json(planned: Planned) -> dict[str, Any]:
    return {
        "points": len(planned.plan.points),
        "duration_s": planned.plan.duration_s,
        "u": planned.u,
    }
