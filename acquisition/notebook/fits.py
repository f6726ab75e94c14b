"""Fits as a notebook shows them: the choice of a model, its parameters, and a chart."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from acquisition.notebook.figures import Points, brdf_figure
from acquisition.results.fitting import Fitted
from acquisition.results.model_check import check_model
from acquisition.results.summary import VERDICTS, parameters_of, value_text
from analysis.choice.choice import Choice, choose
from analysis.choice.fit_json import to_json
from analysis.choice.ladder import METHODS, method_named
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult
from analysis.report.style import escaped
from instrument.errors import InputError
from instrument.geometry import BoolArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from analysis.choice.ladder import MethodOfFit

_MOST_ROWS = 8  # of the table of candidates


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Fit:
    """Choice of the simplest model that explains the data, among all that were fitted.

    choice: the whole outcome. measurements: what was fitted. points, used: what is drawn (N,), and
    a mask (N,) of the points that were fitted.
    """

    choice: Choice
    measurements: Measurements
    points: Points
    used: BoolArray

    @property
    def best(self) -> FitResult | None:
        """The chosen model with `values`, `u` and `brdf(geometry)`; None if no fit converged."""
        return self.choice.best

    @property
    def candidates(self) -> tuple[FitResult, ...]:
        """All fitted models by rising BIC."""
        return tuple(sorted(self.choice.candidates, key=lambda c: c.bic))

    @property
    def verdict(self) -> str:
        """ "adequate", "none adequate" or "not identifiable"; `reason` says why."""
        return self.choice.verdict

    @property
    def reason(self) -> str:
        """Reason for the verdict, in words."""
        return self.choice.reason

    @property
    def notes(self) -> tuple[str, ...]:
        """Further sentences about the fit."""
        return tuple(note.text for note in self.choice.notes)

    @property
    def parameters(self) -> Mapping[str, tuple[float, float | None]]:
        """Value and standard uncertainty of each parameter of the chosen model, in its unit.

        None in place of an uncertainty that the data do not determine.
        """
        best = self.best
        return {} if best is None else {name: (v, best.u[name]) for name, v in best.values.items()}

    def plot(self) -> Figure:
        """Draw the points of every sweep with the chosen model and those next to it by BIC."""
        return brdf_figure(
            self.points, Fitted(self.choice, self.used, self.choice.reason, self.measurements)
        )

    def to_json(self) -> dict[str, Any]:
        """Return the content of `fit.json`."""
        return to_json(self.choice)

    def __repr__(self) -> str:
        if self.best is None:
            return f"<fit of {self.measurements.size} points: {self.verdict}, {self.reason}>"
        values = ", ".join(f"{p.name} {value_text(p)}" for p in parameters_of(self.best))
        size = self.measurements.size
        return f"<fit of {size} points: {self.best.model} ({self.verdict}), {values}>"

    def _repr_html_(self) -> str:
        return "".join(self._html())

    def _html(self) -> Iterator[str]:
        best = self.best
        if best is None:
            yield f"<p>{escaped(f'{self.verdict}: {self.reason}')}</p>"
            return
        yield f"<p><b>{escaped(best.model)}</b>: {escaped(VERDICTS[self.verdict])}.</p>"
        rows = [(p.name, value_text(p)) for p in parameters_of(best)]
        yield _table(("parameter", "value ± u (k = 1)"), rows)
        lowest = min(c.bic for c in self.choice.candidates)
        yield _table(
            ("candidate", "rms/mean", "ΔBIC"),
            [
                (c.model, f"{100 * c.rms_relative:.3g} %", f"{c.bic - lowest:.3g}")
                for c in self.candidates[:_MOST_ROWS]
            ],
        )
        yield f"<p>{escaped(self.reason)}</p>"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    def row(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escaped(cell)}</{tag}>" for cell in cells) + "</tr>"

    return f"<table>{row(header, 'th')}{''.join(row(cells, 'td') for cells in rows)}</table>"


class Fittable(Protocol):
    """Anything that `fit` takes beside plain measurements: a run or a table."""

    def fit(
        self, models: Sequence[str] | None = None, *, method: str = "auto", robust: bool = False
    ) -> Fit:
        """Find the simplest model that explains it."""


def fit(
    data: Fittable | Measurements,
    models: Sequence[str] | None = None,
    *,
    method: str = "auto",
    robust: bool = False,
) -> Fit:
    """Find the simplest model that explains a run, a table or measurements of N points.

    models: names of candidates, sums written with `+`; default: those of a run's protocol, else the
    whole ladder. method: for rough surfaces, "auto", "qualitative", "functional" or "exact".
    robust: give outliers less weight, and list them. Parameters are in the units that
    `MODELS[name].parameters` states, uncertainties are standard ones (k = 1). Measurements alone
    are taken as values of small lamp, lens and patch. Raises `InputError` for an unknown model or
    method, `NotDetermined` if the points are too few for any model or show no light.
    """
    if isinstance(data, Measurements):
        return fit_of(data, None, points_of(data), models=models, method=method, robust=robust)
    return data.fit(models, method=method, robust=robust)


def fit_of(
    measurements: Measurements,
    acceptance: Acceptance | None,
    points: Points,
    *,
    used: BoolArray | None = None,
    models: Sequence[str] | None,
    method: str,
    robust: bool,
    certificate_leads: bool = False,
) -> Fit:
    """Choose a model; `used` is a mask (N,) of the points that are fitted, default all.

    Raises as `fit` does.
    """
    way = _method(method)
    names = None if models is None else _names(models)
    choice = choose(
        measurements, acceptance, names, robust, way, certificate_leads=certificate_leads
    )
    all_points = np.ones(measurements.size, dtype=bool)
    return Fit(choice, measurements, points, all_points if used is None else used)


def _method(text: str) -> MethodOfFit:
    method = method_named(text)
    if method is None:
        raise InputError(f"method: {text!r}; allowed: {', '.join(METHODS)}")
    return method


def _names(models: Sequence[str]) -> list[str]:
    names = [models] if isinstance(models, str) else list(models)
    wrong = [words for words in (check_model(name, None) for name in names) if words]
    if wrong:
        raise InputError(*(f"models: {words}" for words in wrong))
    return names


def points_of(m: Measurements) -> Points:
    """Return measurements (N,) as points to draw, without flags."""
    u = np.full(m.size, np.nan) if m.u_random is None else m.u_random
    unknown = np.full(m.size, np.nan)
    cosine = np.cos(np.radians(m.theta_i_deg))
    return Points(
        theta_i_deg=m.theta_i_deg,
        theta_r_deg=m.theta_r_deg,
        dphi_deg=m.dphi_deg,
        brdf=unknown if m.relative else m.brdf,
        u_brdf=unknown if m.relative else u,
        radiance=m.brdf * cosine,
        u_radiance=u * cosine,
        flags=("",) * m.size,
    )
