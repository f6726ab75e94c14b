"""Table of many fits: a row for each source."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from acquisition.batch.summary import Outcome

_FIRST = ("source", "exit_code", "chosen", "verdict", "rms_relative", "reduced_chi2")


def chosen_of(outcome: Outcome) -> Mapping[str, Any] | None:
    """Candidate that was chosen, as in fit.json."""
    fit = outcome.result
    if fit is None:
        return None
    return next((c for c in fit["candidates"] if c["model"] == fit["chosen"]), None)


def as_csv(outcomes: Sequence[Outcome]) -> str:
    """Table with the parameters of the chosen models, each with its u; empty: not known."""
    names = sorted({name for o in outcomes for name in _parameters(o)})
    of_names = [title for name in names for title in (name, f"u_{name}")]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*_FIRST, *of_names, "message"])
    for o in outcomes:
        own = _parameters(o)
        numbers = [own.get(name, {}).get(key) for name in names for key in ("value", "u")]
        writer.writerow([*_first(o), *numbers, o.reason])
    return text.getvalue()


def _first(o: Outcome) -> list[Any]:
    fit, chosen = o.result or {}, chosen_of(o) or {}
    found = [chosen.get("rms_relative"), chosen.get("reduced_chi2")]
    return [o.source, o.exit_code, fit.get("chosen"), fit.get("verdict"), *found]


def _parameters(o: Outcome) -> Mapping[str, Any]:
    parameters: Mapping[str, Any] = (chosen_of(o) or {}).get("parameters", {})
    return parameters
