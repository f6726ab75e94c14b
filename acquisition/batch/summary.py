"""Outcomes of many fits, and their table: a row for each source."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from instrument.errors import GonioError

_WORST_FIRST = (1, 3, 2, 5)  # exit codes: a fault of the program, a disk, the input, the data
_FIRST = ("source", "exit_code", "chosen", "verdict", "rms_relative", "reduced_chi2")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of the fit of one source.

    exit_code, message: of `gonio fit` of the source alone, 0 and empty where all is well. fit: as
    in fit.json, None where nothing was read. files: content by name, for a folder.
    """

    source: str
    exit_code: int = 0
    message: str = ""
    fit: Mapping[str, Any] | None = None
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def reason(self) -> str:
        """Reason of a failure in one line."""
        first, *more = self.message.splitlines() or [""]
        return f"{first} (and {len(more)} more)" if more else first

    @property
    def chosen(self) -> Mapping[str, Any] | None:
        """Candidate that was chosen, as in fit.json."""
        if self.fit is None:
            return None
        name = self.fit["chosen"]
        return next((c for c in self.fit["candidates"] if c["model"] == name), None)


class SomeFailed(GonioError):
    """Sources without a result; the exit code is that of the worst of them."""

    def __init__(self, outcomes: Sequence[Outcome]) -> None:
        failed = [outcome for outcome in outcomes if outcome.exit_code]
        words = ", ".join(outcome.source for outcome in failed[:3]) + ", ..." * (len(failed) > 3)
        super().__init__(f"{len(failed)} of {len(outcomes)} without a result: {words}")
        codes = {outcome.exit_code for outcome in failed}
        self.exit_code = next(code for code in _WORST_FIRST if code in codes)


def as_json(outcomes: Sequence[Outcome], *, complete: bool) -> dict[str, Any]:
    """Content of the output of --json; `complete`: no source is left out."""
    rows = [
        {"source": o.source, "exit_code": o.exit_code, "message": o.message, "fit": o.fit}
        for o in outcomes
    ]
    return {"complete": complete, "results": rows}


def as_csv(outcomes: Sequence[Outcome]) -> str:
    """Table with the parameters of the chosen models, each with its u; empty: not known."""
    names = sorted({name for o in outcomes for name in (o.chosen or {}).get("parameters", {})})
    of_names = [title for name in names for title in (name, f"u_{name}")]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*_FIRST, *of_names, "message"])
    for o in outcomes:
        writer.writerow([*_first(o), *_parameters(o, names), o.reason])
    return text.getvalue()


def _first(o: Outcome) -> list[Any]:
    fit, chosen = o.fit or {}, o.chosen or {}
    found = [chosen.get("rms_relative"), chosen.get("reduced_chi2")]
    return [o.source, o.exit_code, fit.get("chosen"), fit.get("verdict"), *found]


def _parameters(o: Outcome, names: Sequence[str]) -> list[Any]:
    parameters = (o.chosen or {}).get("parameters", {})
    return [parameters.get(name, {}).get(key) for name in names for key in ("value", "u")]
