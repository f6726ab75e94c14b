"""Files of a fit of any source, as a run has them: report, fit.json and measurements.csv."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from acquisition.commands.outcomes.fitted_table import fitted_table
from acquisition.results.facts.rendered_material import rendered_material
from acquisition.results.report_inputs import candidates_of
from acquisition.results.sources import Source
from acquisition.results.summary import verdict_sentence
from acquisition.results.versions import LIBRARIES, versions_of
from analysis.choice.choice import Choice
from analysis.report.data import ReportData
from analysis.report.page import report_html


def fit_files(
    path: Path, source: Source, choice: Choice | None, fit: Mapping[str, object], notes: list[str]
) -> dict[str, str]:
    """Return the content of each file by its name.

    path: the source. choice: None where no model could be fitted; `fit`, the content of fit.json,
    says why. What only a run knows (rig, pictures, drift, budget) is absent.
    """
    data = _report_data(path, source, choice, str(fit["reason"]), notes)
    return {
        "fit.json": json.dumps(fit, indent=2, allow_nan=False),
        "measurements.csv": fitted_table(source),
        "report.html": report_html(data),
    }


def _report_data(
    path: Path, source: Source, choice: Choice | None, reason: str, notes: list[str]
) -> ReportData:
    m, chosen = source.measurements, None if choice is None else choice.best
    unknown = np.full(m.size, np.nan)
    u = unknown if m.u_random is None else m.u_random
    u = u if chosen is None else chosen.u_total
    return ReportData(
        title=path.name,
        sample=source.sample,
        description="fitted by gonio fit; rig, pictures, drift and budget are known of a run only",
        verdict=(verdict_sentence(choice, reason),),
        verdict_kind="" if choice is None or chosen is None else choice.verdict,
        notes=tuple(notes),
        theta_i_deg=m.theta_i_deg,
        dphi_deg=m.dphi_deg,
        theta_r_deg=m.theta_r_deg,
        brdf=m.brdf,
        u_brdf=u,
        radiance=unknown,
        u_radiance=unknown,
        flags=("",) * m.size,
        fitted=np.full(m.size, choice is not None),
        candidates=() if choice is None else candidates_of(choice),
        relative_brdf=m.relative,
        rendered=rendered_material(chosen, None),
        metadata=_origin(path),
        versions=tuple(versions_of("gonio", *LIBRARIES, "matplotlib").items()),
    )


def _origin(path: Path) -> tuple[tuple[str, str], ...]:
    rows = [("source", str(path))]
    if path.is_file():
        rows.append(("SHA-256", hashlib.sha256(path.read_bytes()).hexdigest()))
    return tuple(rows)
