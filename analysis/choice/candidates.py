"""The models that compete for the data: their first fits, and which of these are worth more."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.accuracy.cheapest import cheapest
from analysis.accuracy.rough_surface import ROUGH_SURFACE
from analysis.choice.ladder import SAME_PREDICTION, approximation
from analysis.data.acceptance import Acceptance
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFit, determined, multi_start, quick_fit
from analysis.fit.fit import FitResult, refined
from analysis.fit.relative_scale import NAME as RELATIVE_FACTOR
from analysis.fit.relative_scale import normalise_lamp_levels
from analysis.models import MODELS
from instrument.errors import NotDetermined

# A first fit with so many times the best one's chi2 is not brought near it by averaging over the
# rig, or from another basin.
_HOPELESS = 25.0


@dataclass(frozen=True, slots=True)
class Candidates:
    """First fits to the measurements, in the order of the names, and names with too few points.

    every: an integrated model is fitted whether or not it may differ from its functional form.
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
        """First fits of the models called so.

        Raises `NotDetermined` where the points are too few for any, `KeyError` for an unknown one.
        """
        found = cls(measurements, robust, every).with_more(names)
        if not found.first:
            raise NotDetermined(
                f"{measurements.size} points are too few to fit any of: {', '.join(names)}"
            )
        if measurements.free_levels:
            level = normalise_lamp_levels(measurements, _best(found.first).brdf)
            return cls(level, robust, every).with_more(names)
        return found

    def with_more(self, names: Sequence[str]) -> Candidates:
        """These candidates and further ones."""
        m = self.measurements
        quick = {f.problem.model.name: f for f in self.first}
        named = [MODELS[name] for name in names]
        for model in (model for model in named if determined(model, m)):
            form = quick.get(approximation(model.name) or "")
            if self.every or form is None or _leaves_integral(form, m):
                quick[model.name] = quick_fit(model, m)
        best = _best(quick.values()) if quick else None
        first = tuple(
            f if best is None or _ruled_out(f, best, m) else multi_start(f, m, self.robust)
            for f in quick.values()
        )
        few = tuple(model.name for model in named if not determined(model, m))
        return replace(self, first=first, left_out=(*self.left_out, *few))

    def refined(self, acceptance: Acceptance | None) -> tuple[FitResult, ...]:
        """Each fitted with all uncertainties, around the smooth curve of the best one."""
        m, best = self.measurements, _best(self.first)
        return tuple(
            refined(f, m, acceptance, best.brdf, _ruled_out(f, best, m)) for f in self.first
        )


def _best(first: Iterable[FirstFit]) -> FirstFit:
    return min(first, key=lambda f: (not f.solution.converged, f.bic))


def _leaves_integral(form: FirstFit, measurements: Measurements) -> bool:
    """Whether the functional form, as fitted, is off the integral by more than u/3 anywhere."""
    names = [p.name for p in form.problem.model.parameters]
    values = dict(zip(names, map(float, form.solution.x), strict=True))
    at = {name: values[name] for name in ("albedo", "sigma_deg")}
    rough = MODELS["oren_nayar"].brdf(measurements.geometry, **at)
    rough *= values.get(RELATIVE_FACTOR, 1.0)
    u = measurements.u_random
    if u is None:
        left = form.problem.predict(form.solution.x) - measurements.brdf
        u = np.full(measurements.size, float(np.sqrt(np.mean(np.square(left)))))
    allowed = np.divide(SAME_PREDICTION * u, np.abs(rough), out=np.ones_like(u), where=rough != 0)
    # Data without noise may ask for more than even the integral keeps.
    allowed = np.maximum(allowed, ROUGH_SURFACE.accuracy(measurements.geometry))
    ranges = {name: (value, value) for name, value in at.items()}
    found = cheapest(ROUGH_SURFACE, measurements.geometry, ranges, allowed, among=("functional",))
    return found.method != "functional"


def _ruled_out(fit: FirstFit, best: FirstFit, m: Measurements) -> bool:
    """Whether neither averaging over the rig nor another basin can bring a model near the best."""
    enough = 0.0 if m.u_random is None else float(m.size)
    return fit.solution.chi2 > _HOPELESS * max(best.solution.chi2, enough)
