"""Candidate models: their first fits, and the full fits of those that may compete."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.choice.ladder import SAME_PREDICTION, functional_form
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.criteria import enough_chi2
from analysis.fit.first_fit import FirstFit, FirstFits, enough_points
from analysis.fit.fit import FitResult, refine
from analysis.fit.relative_scale import FACTOR_NAME, normalise_lamp_levels
from analysis.models import MODELS, Model
from instrument.errors import NotDetermined

# chi2 relative to the lowest, both on a part of very many points: a smaller model that is preferred
# to a larger one has hardly more. It is beyond this factor with all points as well.
_HOPELESS, _HOPELESS_OF_ALL = 1.5, 1.25


@dataclass(frozen=True, slots=True)
class Candidates:
    """First fits to the measurements in the order of the names, and models left out.

    every: fit an integrated model even where its functional form is accurate enough. ladder: rungs
    of all candidates, of which, of very many points, those are fitted roughly that are far behind
    on a part of them; empty: all are fitted. left_out: models with too many parameters for the
    points.
    """

    fits: FirstFits
    robust: bool
    every: bool
    ladder: Sequence[Sequence[str]] = ()
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
    ) -> Candidates:
        """First fits of the named models.

        Raises `NotDetermined` where the points are too few for all, `KeyError` for an unknown one.
        """
        found = cls(FirstFits(measurements), robust, every, ladder).with_more(names)
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
        hopeless = self._hopeless(enough) if self.ladder else set()
        for model in enough:
            form = first.get(functional_form(model.name) or "")
            if self.every or form is None or _form_inaccurate(form, m):
                fitted = self.fits.roughly if model.name in hopeless else self.fits.of
                first[model.name] = fitted(model)
        few = tuple(model.name for model in named if not enough_points(model, m))
        return replace(self, first=tuple(first.values()), left_out=(*self.left_out, *few))

    def _hopeless(self, models: Sequence[Model]) -> set[str]:
        """Models whose chi2 on a part of very many points is far above the lowest there.

        They are fitted to the part alone: chi2 of all points is then known to about a hundredth,
        which is no reason to prefer one. Only for points that share no errors, which else may
        explain most of chi2.
        """
        part = self.fits.part
        if part is None:
            return set()
        chi2 = {model.name: part.of(model).solution.chi2 for model in models}
        least = min(*chi2.values(), _least_chi2(part, self.ladder))
        return {name for name, own in chi2.items() if own > _HOPELESS * least}

    def checked(self) -> Candidates:
        """The candidates, with those fitted to all points that are not far behind there.

        Without this a model would be left out whose misfit lies where the part has many points.
        """
        least = min((f.solution.chi2 for f in self.first if not f.rough), default=math.inf)
        most = _HOPELESS_OF_ALL * least
        checked = (
            self.fits.of(f.model) if f.rough and f.solution.chi2 <= most else f for f in self.first
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


def _least_chi2(part: FirstFits, ladder: Iterable[Sequence[str]]) -> float:
    """Least chi2 of the models up to the first rung that explains the part of the points.

    Without the integrated models, which are costly: a functional form is hardly farther off.
    """
    least = math.inf
    for rung in ladder:
        quick = [MODELS[name] for name in rung if functional_form(name) is None]
        fits = [part.of(model) for model in quick]
        least = min([least, *(one.solution.chi2 for one in fits)])
        if any(one.solution.chi2 <= enough_chi2(part.measurements, one.problem) for one in fits):
            break
    return least


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
