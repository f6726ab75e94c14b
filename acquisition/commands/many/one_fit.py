"""Fit of one source among many, in a process of this computer or of a cluster."""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path

from acquisition.batch.summary import Outcome
from acquisition.commands.fit import Asked, fit_of, report_files
from acquisition.commands.fit_status import require_result
from acquisition.commands.many.one_source import outcome_of
from analysis.choice.fit_json import no_fit_json
from instrument.errors import NotDetermined


def fit_one(named: tuple[str, Path], asked: Asked, report: bool) -> Outcome:
    """Fit a source, given by name and path, as `gonio fit` does; no error leaves this function.

    `report`: make the files of `gonio fit --out`.
    """
    return outcome_of(named, "fit", partial(_fit_one, asked=asked, report=report))


def _fit_one(name: str, path: Path, asked: Asked, report: bool) -> Outcome:
    try:
        fitted = fit_of(path, asked, lambda _: contextlib.nullcontext())
    except NotDetermined as error:
        found = no_fit_json(error)
        return Outcome(source=name, exit_code=error.exit_code, message=str(error), result=found)
    files = report_files(path, fitted) if report else {}
    code, message = 0, ""
    try:
        require_result(fitted.json, name)
    except NotDetermined as error:
        code, message = error.exit_code, str(fitted.json["reason"])
    return Outcome(source=name, exit_code=code, message=message, result=fitted.json, files=files)
