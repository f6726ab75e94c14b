"""Candidate models: their first fits, and the full fits of those that may compete."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.choice.ladder import SAME_PREDICTION, functional_form
from analysis.data.acceptance import Acceptance
from analysis.data.covariance import full_covariance, has_shared_errors
from analysis.data.measurements import Measurements
from analysis.fit.criteria import enough_chi2
from analysis.fit.first_fit import FirstFit, FirstFits, enough_points
from analysis.fit.fit import FitResult, refine
from analysis.fit.relative_scale import FACTOR_NAME, normalise_lamp_levels
from analysis.models import MODELS, Model
from instrument.errors import NotDetermined

# chi2 relative to the lowest, both on a part of very many points, beyond which a model is not
# fitted to all: a smaller model that is preferred to a larger one has hardly more. Errors that
# points share may explain much of chi2, and so may averaging: the larger factor. With all points
# chi2 is then above the lowest by at least this part of that factor.
_HOPELESS, _HOPELESS_WITH_SHARED, _OF_ALL = 1.5, 10.0, 0.8
# Relative tolerance and steps of the fit to the part with shared errors.
_QUICK_RTOL, _QUICK_STEPS = 1e-2, 5


@dataclass(frozen=True, slots=True)
class Screen:
    """Search for models that are far behind on a part of very many points.

    part: first fits to it. ladder: rungs of all candidates. with_shared: errors that points share
    are stated, or the model is averaged. known: chi2 by name of the model.
    """

    part: FirstFits
    ladder: Sequence[Sequence[str]]
    with_shared: bool
    known: dict[str, float] = field(default_factory=dict)

    @property
    def factor(self) -> float:
        """chi2 over the lowest, beyond which a model is far behind."""
        return _HOPELESS_WITH_SHARED if self.with_shared else _HOPELESS

    def hopeless(self, models: Iterable[Model]) -> set[str]:
        """Names of the models that are far behind the best that the ladder has for the part."""
        chi2 = {model.name: self._chi2(model) for model in models}
        least = min(self._least(), min(chi2.values(), default=math.inf))
        return {name for name, own in chi2.items() if own > self.factor * least}

    def _least(self) -> float:
        """Least chi2 of the models up to the first rung that explains the part.

        Without the integrated models, which are costly: a functional form is hardly farther off.
        """
        least = math.inf
        for rung in self.ladder:
            quick = [MODELS[name] for name in rung if functional_form(name) is None]
            least = min([least, *map(self._chi2, quick)])
            problem = self.part.of(quick[0]).problem
            if least <= enough_chi2(self.part.measurements, problem):
                break
        return least

    def _chi2(self, model: Model) -> float:
        if model.name not in self.known:
            first, m = self.part.of(model), self.part.measurements
            chi2 = first.solution.chi2
            if has_shared_errors(m) and m.u_random is not None:
                problem = replace(first.problem, covariance=full_covariance(m, first.brdf))
                start, steps = first.solution.x, _QUICK_STEPS
                chi2 = problem.solve(start, rtol=_QUICK_RTOL, most_steps=steps).chi2
            self.known[model.name] = chi2
        return self.known[model.name]


@dataclass(frozen=True, slots=True)
class Candidates:
    """First fits to the measurements in the order of the names, and models left out.

    every: fit an integrated model even where its functional form is accurate enough. screen: of
    models that are fitted to a part of very many points alone, as they are far behind there: chi2
    of all points is then known to about a hundredth, with errors that points share within a factor
    of two, which is no reason to prefer one. None: all are fitted to all points. left_out: models
    with too many parameters for the points.
    """

    fits: FirstFits
    robust: bool
    every: bool
    screen: Screen | None = None
    first: tuple[FirstFit, ...] = ()
    left_out: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        measurements: Measurements,
        robust: bool,
        every: bool,
        ladder: Sequence[Sequence[str]] = (),
        averaged: bool = False,
    ) -> Candidates:
        """First fits of the named models.

        ladder: rungs of all candidates, which are screened; empty: they are not. averaged: the
        models will be averaged as the rig does. Raises `NotDetermined` where the points are too few
        for all, `KeyError` for an unknown one.
        """
        fits = FirstFits(measurements)
        screen = None
        if fits.part is not None and ladder:
            screen = Screen(fits.part, ladder, averaged or has_shared_errors(measurements))
        found = cls(fits, robust, every, screen).with_more(names)
        if not found.first:
            n = measurements.size
            few = "1 point is" if n == 1 else f"{n} points are"
            raise NotDetermined(f"{few} too few to fit any of: {', '.join(names)}")
        return found

    @property
    def measurements(self) -> Measurements:
        """The measurements, with free lamp levels as the best first fit has them."""
        return normalise_lamp_levels(self.fits.measurements, _best(self.first).brdf)

    def with_more(self, names: Sequence[str]) -> Candidates:
        """Add further models to the candidates."""
        m = self.fits.measurements
        first = {f.model.name: f for f in self.first}
        named = [MODELS[name] for name in names]
        enough = [model for model in named if enough_points(model, m)]
        hopeless = self.screen.hopeless(enough) if self.screen else set()
        for model in enough:
            form = first.get(functional_form(model.name) or "")
            if self.every or form is None or _form_inaccurate(form, m):
                fitted = self.fits.roughly if model.name in hopeless else self.fits.of
                first[model.name] = fitted(model)
        few = tuple(model.name for model in named if not enough_points(model, m))
        return replace(self, first=tuple(first.values()), left_out=(*self.left_out, *few))

    def checked(self, results: Iterable[FitResult]) -> Candidates:
        """The candidates, with those fitted to all points that are not far behind there.

        results: of all of them. Without this a model would be left out whose misfit lies where the
        part has many points.
        """
        if self.screen is None:
            return self
        chi2 = {c.model: c.problem.chi2(c.x) if c.chi2 is None else c.chi2 for c in results}
        whole = [chi2[f.model.name] for f in self.first if not f.rough]
        most = _OF_ALL * self.screen.factor * min(whole, default=math.inf)
        checked = (
            self.fits.of(f.model) if f.rough and chi2[f.model.name] <= most else f
            for f in self.first
        )
        return replace(self, first=tuple(checked))

    def refined(
        self,
        acceptance: Acceptance | None,
        already: Container[str] = (),
    ) -> tuple[FitResult, ...]:
        """Fit each, but for those `already` fitted, as `fit` does, without u of the parameters."""
        m = self.fits.measurements
        return tuple(
            refine(f, m, acceptance, self.robust, u="none")
            for f in self.first
            if f.model.name not in already
        )

    def profiled(self, name: str, acceptance: Acceptance | None) -> FitResult:
        """Fit the candidate of that name with all uncertainties and intervals."""
        (own,) = (f for f in self.first if f.model.name == name)
        return refine(self.fits.polished(own), self.fits.measurements, acceptance, self.robust)


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
