"""Models that are special cases of others: with which parameters one BRDF becomes another.

A fit of the larger model then has no larger chi2 than one of the smaller: the fit starts from the
smaller one's too. `SPECIAL_CASES` states it for single models; for sums it follows, as a term may
be left out where its scales of 0 leave nothing of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from analysis.models import MODELS, Model
from analysis.models.base import add, named_terms
from instrument.geometry import Geometry

At = Mapping[str, float | str]
"""For parameters of a model: a value, or the name of the special case's parameter to take."""

_SIGMA_0: At = {"albedo": "albedo", "sigma_deg": 0.0}
_KS, _SIGMA, _LOBE = "ks", "sigma_deg", "lobe_sigma_deg"

SPECIAL_CASES: Mapping[str, Mapping[str, At]] = {
    "minnaert": {"lambert": {"albedo": "albedo", "k": 1.0}},
    "oren_nayar_qualitative": {"lambert": _SIGMA_0},
    "oren_nayar": {"lambert": _SIGMA_0},
    "oren_nayar_exact": {"lambert": _SIGMA_0},
    "oren_nayar_weighted": {
        "lambert": _SIGMA_0,
        "oren_nayar": {"albedo": "albedo", "sigma_deg": "sigma_deg", "interreflection": 1.0},
    },
    "eon": {"lambert": {"albedo": "albedo", "roughness": 0.0}},
    "wolff_oren_nayar": {"lambert": {**_SIGMA_0, "n": 1.0}},
    "torrance_sparrow_lobe": {"torrance_sparrow": {_KS: _KS, _LOBE: _SIGMA}},
    "unified": {"lambert": {"diffuse": "albedo", "lobe": 0.0, "spike": 0.0}},
    "ggx_f90": {"ggx": {"f0": "f0", "f90": 1.0, "alpha": "alpha"}},
}  # fmt: skip
"""By the name of a model, its special cases and the values at which it becomes them."""

_ANY = Geometry.from_degrees(theta_i=[20.0, 50.0], theta_r=[35.0, 60.0], dphi=[30.0, 170.0])


@dataclass(frozen=True, slots=True)
class SpecialCase:
    """A model that another contains, and values `at` which the other becomes it."""

    model: Model
    at: At

    @property
    def name(self) -> str:
        """Name of the contained model."""
        return self.model.name

    def embed(self, values: Mapping[str, float], larger: Model) -> dict[str, float]:
        """Parameters of the larger model at which it has the BRDF of the special case at `values`.

        In the parameters' units. A parameter without effect there has its default; the values may
        lie outside the larger model's domain.
        """
        at = {p.name: self.at.get(p.name, p.default) for p in larger.parameters}
        return {name: values[v] if isinstance(v, str) else v for name, v in at.items()}


@cache
def special_cases(model: Model) -> tuple[SpecialCase, ...]:
    """Special cases of a model or sum, for single terms and for several at once.

    A model that is not listed in `MODELS` has those of the terms of its sum.
    """
    found: dict[tuple[object, ...], SpecialCase] = {}
    for cases in itertools.product(*map(_cases, named_terms(model))):
        terms = [term for term, _ in cases if term is not None]
        names = [term.name for term in terms]
        at = _merged([at for _, at in cases])
        if at is None or not names or len(set(names)) < len(names) or "+".join(names) == model.name:
            continue
        case = SpecialCase(terms[0] if len(terms) == 1 else add(*terms), at)
        found[(case.name, *sorted(map(str, at.items())))] = case
    return tuple(found.values())


def _cases(term: Model) -> Iterator[tuple[Model | None, At]]:
    """A term of a sum as it is, as one of its special cases, and (None) left out."""
    yield term, {p.name: p.name for p in term.parameters}
    for name, at in SPECIAL_CASES.get(term.name, {}).items():
        yield MODELS[name], at
    zeros = {p.name: 0.0 for p in term.parameters if p.scale or p.level}
    others = {p.name: p.default for p in term.parameters if p.name not in zeros}
    if zeros and not np.any(term.kernel(_ANY, **zeros, **others)):
        yield None, zeros


def _merged(parts: list[At]) -> At | None:
    """All values together, or None where two terms need different ones of a shared parameter."""
    merged: dict[str, float | str] = {}
    for part in parts:
        for name, value in part.items():
            if merged.setdefault(name, value) != value:
                return None
    return merged
