"""Content of `fit.json`: the choice of a model as plain values for JSON."""

from __future__ import annotations

import math
from collections.abc import Container
from typing import Any

from analysis.choice.choice import Choice
from analysis.choice.symmetry_test import Symmetry
from analysis.fit.fit import FitResult
from analysis.fit.scale_ratios import Ratio
from analysis.fit.shared_values import SharedValue, shared_values
from instrument.errors import NoMeasurement, NotDetermined


def to_json(choice: Choice) -> dict[str, Any]:
    """Convert a choice for `json.dumps(..., allow_nan=False)`."""
    u_scale = {} if choice.u_scale is None else {"u_scale": _number(choice.u_scale)}
    return {
        "chosen": choice.chosen,
        "verdict": choice.verdict,
        **u_scale,
        "reason": choice.reason,
        "notes": [note.json for note in choice.notes],
        "symmetry": None if choice.symmetry is None else _symmetry(choice.symmetry),
        "shared_errors": [
            _shared(e)
            for c in choice.candidates
            if c.model == choice.chosen
            for e in shared_values(c)
        ],
        "candidates": [_candidate(c, choice.agreeing) for c in choice.candidates],
    }


def no_fit_json(error: NotDetermined) -> dict[str, Any]:
    """Content where no model could be fitted; without a measurement there is no verdict."""
    found = to_json(Choice((), None, "not identifiable", str(error)))
    return {**found, "verdict": None} if isinstance(error, NoMeasurement) else found


def _candidate(result: FitResult, agreeing: Container[str]) -> dict[str, Any]:
    return {
        "model": result.model,
        "parameters": {name: _parameter(result, name) for name in result.values},
        "rms_relative": _number(result.rms_relative),
        "reduced_chi2": _number(result.reduced_chi2),
        "bic": _number(result.bic),
        "aicc": _number(result.aicc),
        "converged": result.converged,
        "agrees": result.model in agreeing,
        "message": result.message,
        "ratios": {name: _ratio(ratio) for name, ratio in result.ratios.items()},
    }


def _shared(error: SharedValue) -> dict[str, Any]:
    """Most likely value of a shared error, in units of its stated u."""
    return {"name": error.name, "value_in_u": _number(error.value), "u_in_u": _number(error.u)}


def _symmetry(tested: Symmetry) -> dict[str, Any]:
    return {
        "says": tested.outcome,
        "pairs": tested.pairs,
        "asymmetry": _number(tested.asymmetry),
        "probability": _number(tested.probability),
    }


def _parameter(result: FitResult, name: str) -> dict[str, Any]:
    """Value and u; without u the profile interval, or the domain where no profile was computed."""
    interval = result.intervals.get(name)
    if result.u[name] is None and interval is None:
        domain = next(p for p in result.problem.model.parameters if p.name == name)
        interval = domain.low, domain.high
    return _estimate(result.values[name], result.u[name], interval)


def _ratio(ratio: Ratio) -> dict[str, Any]:
    return _estimate(ratio.value, ratio.u, ratio.interval)


def _estimate(
    value: float, u: float | None, interval: tuple[float, float] | None
) -> dict[str, Any]:
    entry: dict[str, Any] = {"value": _number(value), "u": _number(u)}
    if interval is not None:
        entry["interval"] = [_number(end) for end in interval]
    return entry


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
