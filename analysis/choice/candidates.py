"""Candidate models: their first fits, and the full fits of those that may compete."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.choice.ladder import SAME_PREDICTION, functional_form
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFit, enough_points, multi_start, quick_fit
from analysis.fit.fit import FitResult, refine
from analysis.fit.relative_scale import FACTOR_NAME, normalise_lamp_levels
from analysis.models import MODELS
from instrument.errors import NotDetermined

# Ratio of chi2 to that of the best first fit, beyond which neither averaging over the rig nor
# another local minimum makes a model competitive.
_RULED_OUT_CHI2 = 25.0


@dataclass(frozen=True, slots=True)
class Candidates:
    """First fits to the measurements in the order of the names, and models left out.

    every: fit an integrated model even where its functional form is accurate enough.
    left_out: models with too many parameters for the points.
    """

    measurements: Measurements
    robust: bool
    every: bool
    first: tuple[FirstFit, ...] = ()
    left_out: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, names: Sequence[str], measurements: Measurements, robust: bool, every: bool
    ) -> Candidates:
        """First fits of the named models.

        Raises `NotDetermined` where the points are too few for all, `KeyError` for an unknown one.
        """
        found = cls(measurements, robust, every).with_more(names)
        if not found.first:
            raise NotDetermined(
                f"{measurements.size} points are too few to fit any of: {', '.join(names)}"
            )
        if measurements.free_levels:
            normalised = normalise_lamp_levels(measurements, _best(found.first).brdf)
            return cls(normalised, robust, every).with_more(names)
        return found

    def with_more(self, names: Sequence[str]) -> Candidates:
        """Add further models to the candidates."""
        m = self.measurements
        quick = {f.problem.model.name: f for f in self.first}
        named = [MODELS[name] for name in names]
        for model in (model for model in named if enough_points(model, m)):
            form = quick.get(functional_form(model.name) or "")
            if self.every or form is None or _form_inaccurate(form, m):
                quick[model.name] = quick_fit(model, m)
        best = _best(quick.values()) if quick else None
        complete = [f.problem.model.name for f in self.first]
        first = tuple(
            f
            if name in complete or best is None or _ruled_out(f, best, m)
            else multi_start(f, m, self.robust)
            for name, f in quick.items()
        )
        few = tuple(model.name for model in named if not enough_points(model, m))
        return replace(self, first=first, left_out=(*self.left_out, *few))

    def refined(
        self,
        acceptance: Acceptance | None,
        already: Container[str] = (),
        *,
        thoroughly: bool = True,
    ) -> tuple[FitResult, ...]:
        """Fit each, but for those `already` fitted, with the uncertainties that are linear.

        Unless `thoroughly`, one that is far off with all uncertainties rules out those whose first
        fits are worse: a candidate with more parameters is needed.
        """
        m, best = self.measurements, _best(self.first)
        new = [f for f in self.first if f.problem.model.name not in already]
        found: dict[str, FitResult] = {}
        enough = True
        for f in sorted(new, key=lambda f: f.solution.chi2):
            ruled_out = _ruled_out(f, best, m) or not enough
            result = refine(f, m, acceptance, best.brdf, ruled_out, profiles=False)
            found[f.problem.model.name] = result
            enough &= thoroughly or (result.reduced_chi2 or 0.0) <= _RULED_OUT_CHI2
        return tuple(found[f.problem.model.name] for f in new)

    def profiled(self, name: str, acceptance: Acceptance | None) -> FitResult:
        """Fit the candidate of that name with all uncertainties and intervals."""
        best = _best(self.first)
        (own,) = (f for f in self.first if f.problem.model.name == name)
        return refine(own, self.measurements, acceptance, best.brdf)


def _best(first: Iterable[FirstFit]) -> FirstFit:
    return min(first, key=lambda f: (not f.solution.converged, f.bic))


def _form_inaccurate(form: FirstFit, measurements: Measurements) -> bool:
    """True if the fitted functional form deviates from the integral by more than u/3 anywhere."""
    names = [p.name for p in form.problem.model.parameters]
    values = dict(zip(names, map(float, form.solution.x), strict=True))
    at = {name: values[name] for name in ("albedo", "sigma_deg")}
    rough = MODELS["oren_nayar"].brdf(measurements.geometry, **at)
    rough *= values.get(FACTOR_NAME, 1.0)
    u = measurements.u_random
    if u is None:
        residual = form.problem.predict(form.solution.x) - measurements.brdf
        u = np.full(measurements.size, float(np.sqrt(np.mean(np.square(residual)))))
    allowed = np.divide(SAME_PREDICTION * u, np.abs(rough), out=np.ones_like(u), where=rough != 0)
    # Data without noise may require more than the accuracy of the integral itself.
    allowed = np.maximum(allowed, ROUGH_SURFACE.accuracy(measurements.geometry))
    ranges = {name: (value, value) for name, value in at.items()}
    found = cheapest(ROUGH_SURFACE, measurements.geometry, ranges, allowed, among=("functional",))
    return found.method != "functional"


def _ruled_out(fit: FirstFit, best: FirstFit, m: Measurements) -> bool:
    """True if neither averaging nor another local minimum can make a model competitive."""
    enough = 0.0 if m.u_random is None else float(m.size)
    return fit.solution.chi2 > _RULED_OUT_CHI2 * max(best.solution.chi2, enough)
