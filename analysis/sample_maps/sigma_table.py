"""Table of a rough surface's BRDF over sigma: its parts that go with albedo, albedo^2, and ks.

Oren and Nayar's BRDF is linear in the albedo (light of one bounce) and in its square (two bounces);
a lobe is linear in ks. For a given sigma these parameters are found without a search, and a fit of
many cells at the same geometries needs the parts at some sigma only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models import MODELS
from analysis.models.base import Model, named_terms
from instrument.geometry import FloatArray, Geometry

BODIES = ("oren_nayar", "oren_nayar_exact", "oren_nayar_qualitative")
LOBE = "torrance_sparrow"
MAPPED = (*BODIES, *(f"{body}+{LOBE}" for body in BODIES))
"""Models that a map can fit."""

_STEP_DEG = 0.75  # of sigma without a lobe
# A lobe changes by its width, so that the steps grow with sigma beyond this angle; their number.
_NARROW_DEG, _LOBE_STEPS = 3.0, 100


@dataclass(frozen=True, slots=True)
class SigmaTable:
    """Parts of a model's BRDF at S values of sigma and K geometries.

    sigma_deg: (S,), rising; evenly without a lobe, with one as sigma + a few degrees evenly in the
    logarithm. once, twice: (S, K), what goes with albedo and with albedo^2, in 1/sr. lobe: (S, K),
    what goes with ks, in 1/sr; None without a lobe.
    """

    sigma_deg: FloatArray
    once: FloatArray
    twice: FloatArray
    lobe: FloatArray | None

    @classmethod
    def of(cls, model: str, geometry: Geometry) -> SigmaTable:
        """Return a table in 1/sr at geometries (K,); `ValueError` for a model not in `MAPPED`."""
        if model not in MAPPED:
            raise ValueError(f"model {model!r}; allowed for a map: {', '.join(MAPPED)}")
        terms = named_terms(MODELS[model])
        nodes = _nodes(*_domain(MODELS[model]), narrow=len(terms) > 1)
        white, grey = (_over_sigma(terms[0], geometry, nodes, albedo=a) for a in (1.0, 0.5))
        twice = 2 * white - 4 * grey
        lobe = _over_sigma(terms[1], geometry, nodes, ks=1.0) if len(terms) > 1 else None
        return cls(nodes, white - twice, twice, lobe)

    def sigma_at(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return sigma and its derivative by the place, in degrees, at places (...) in the table.

        A place counts the values from 0 and may lie between two of them; below 0 only where the
        table is even: at minus sigma.
        """
        last = self.sigma_deg.size - 1
        low, high = self.sigma_deg[0], self.sigma_deg[-1]
        if self.lobe is None:
            step = (high - low) / last
            return low + step * place, np.full(place.shape, step)
        rate = np.log((high + _NARROW_DEG) / (low + _NARROW_DEG)) / last
        shifted = (low + _NARROW_DEG) * np.exp(rate * place)
        return shifted - _NARROW_DEG, rate * shifted

    def place_of(self, sigma_deg: FloatArray) -> FloatArray:
        """Return the places (...) in the table of values of sigma (...) in degrees."""
        low, high, last = self.sigma_deg[0], self.sigma_deg[-1], self.sigma_deg.size - 1
        if self.lobe is None:
            return np.asarray((sigma_deg - low) * (last / (high - low)))
        shifted = (sigma_deg + _NARROW_DEG) / (low + _NARROW_DEG)
        return np.asarray(
            np.log(shifted) * (last / np.log((high + _NARROW_DEG) / (low + _NARROW_DEG)))
        )

    @property
    def even(self) -> bool:
        """True if the table begins at sigma = 0, about which it is symmetric."""
        return bool(self.sigma_deg[0] == 0)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters that a fit with this table determines."""
        return ("albedo", "sigma_deg") if self.lobe is None else ("albedo", "sigma_deg", "ks")


def _nodes(low: float, high: float, *, narrow: bool) -> FloatArray:
    if not narrow:
        return np.linspace(low, high, round((high - low) / _STEP_DEG) + 1)
    return np.geomspace(low + _NARROW_DEG, high + _NARROW_DEG, _LOBE_STEPS + 1) - _NARROW_DEG


def _domain(model: Model) -> tuple[float, float]:
    (sigma,) = (p for p in model.parameters if p.name == "sigma_deg")
    return sigma.low, sigma.high


def _over_sigma(model: Model, geometry: Geometry, nodes: FloatArray, **values: float) -> FloatArray:
    """BRDF (S, K) in 1/sr at each sigma of `nodes` (S,) in degrees, other parameters alike."""
    return np.array([model.brdf(geometry, sigma_deg=float(s), **values) for s in nodes])
