"""Results of a record: reduce, fit, and write measurements.csv, fit.json and report.html."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from acquisition.results.facts.chosen_geometries import reasons
from acquisition.results.fitting import fit_run
from acquisition.results.measurements_csv import measurements_csv
from acquisition.results.reduction import reduced_run
from acquisition.results.report_inputs import report_data
from acquisition.results.summary import headline, notes, parameters_of, scan_state
from analysis.report.data import Parameter, ReportData
from analysis.report.page import write_report
from instrument.config.load import Loaded
from instrument.errors import NoMeasurement, StorageError
from instrument.record.record import Record
from instrument.text.atomic_file import write_whole


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results to print; `fit` is the content of fit.json.

    state: the scan is complete, or what is missing of it. content: that of the report.
    """

    state: str
    headline: str
    parameters: tuple[Parameter, ...]
    notes: tuple[str, ...]
    fit: dict[str, object]
    report: Path
    content: ReportData


def finish(record: Record, loaded: Loaded) -> Outcome:
    """Reduce, fit and report; each file in the run's folder is written completely or not at all.

    Raises `NoMeasurement` where nothing was measured, `StorageError` where the disk fails.
    """
    reduced = reduced_run(record, loaded)
    if not reduced.points:
        raise NoMeasurement(f"no geometry has been measured yet: {scan_state(record)}")
    fitted = fit_run(reduced, loaded)
    u_brdf, parts = fitted.u_brdf(reduced), fitted.parts(reduced)
    said, remarks, fit = headline(fitted), notes(reduced, fitted, record, loaded), fitted.as_json()
    with _recovery_named(record.folder):
        table = measurements_csv(reduced, u_brdf, parts, loaded, reasons(record))
        write_whole(record.folder / "measurements.csv", table)
        write_whole(record.folder / "fit.json", json.dumps(fit, indent=2, allow_nan=False))
    content = report_data(
        reduced, fitted, record, loaded, u_brdf=u_brdf, parts=parts, headline=said, notes=remarks
    )
    report = record.folder / "report.html"
    with _recovery_named(record.folder):
        write_report(report, content)
    parameters = () if fitted.chosen is None else parameters_of(fitted.chosen)
    return Outcome(scan_state(record), said, parameters, remarks, fit, report, content)


@contextmanager
def _recovery_named(run: Path) -> Iterator[None]:
    """Add to a `StorageError` the command that writes the results later."""
    try:
        yield
    except StorageError as error:
        text = f"{error}. Nothing measured is lost; then: gonio report {run}"
        raise StorageError(text) from error
