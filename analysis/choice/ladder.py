"""Candidate models of the automatic choice, in rungs by number of parameters.

Rungs are tried until one explains the data; `choice.choose` says when the next one is tried as
well. Methods for the same physics are ordered by cost: of those that the data cannot distinguish,
the first is taken. The candidates are the papers' models and sums, and, for real materials, gloss
without Fresnel's law and light scattered inside.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Literal, get_args

from analysis.models import MODELS

MethodOfFit = Literal["auto", "qualitative", "functional", "exact"]
"""Method for the BRDF of the rough surface; auto: the cheapest that is accurate enough."""

CANDIDATES = (
    "lambert",
    "oren_nayar_qualitative",
    "oren_nayar",
    "oren_nayar_exact",
    "wolff",
    "minnaert",
    "eon",
    "torrance_sparrow",
    "torrance_sparrow_lobe",
    "ggx",
    "lambert+torrance_sparrow",
    "oren_nayar_qualitative+torrance_sparrow",
    "oren_nayar+torrance_sparrow",
    "oren_nayar_exact+torrance_sparrow",
    "lambert+torrance_sparrow_lobe",
    "lambert+ggx",
    "wolff_oren_nayar",
    "beckmann_spizzichino",
    "oren_nayar+torrance_sparrow_lobe",
    "oren_nayar+ggx",
    "wolff+torrance_sparrow",
    "wolff+torrance_sparrow_lobe",
    "wolff+ggx",
    "lambert+beckmann_spizzichino",
    "minnaert+single_scattering",
    "unified",
    "oren_nayar+beckmann_spizzichino",
    "wolff+beckmann_spizzichino",
    "lambert+ggx+single_scattering",
    "lambert+torrance_sparrow_lobe+single_scattering",
    "oren_nayar+torrance_sparrow+single_scattering",
    "oren_nayar_exact+torrance_sparrow+single_scattering",
    "eon+ggx_f90",
    "minnaert+ggx_f90",
)

# Predictions that differ by less than this fraction of u are equivalent.
SAME_PREDICTION = 1 / 3

# The rough diffuse surface by rising cost: one physics, three methods.
_ROUGH = ("oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact")
_EXACT, _FUNCTIONAL = "oren_nayar_exact", "oren_nayar"
_BY_METHOD = {
    "qualitative": "oren_nayar_qualitative", "functional": _FUNCTIONAL, "exact": _EXACT,
}  # fmt: skip
METHODS: tuple[MethodOfFit, ...] = get_args(MethodOfFit)


def method_named(text: str) -> MethodOfFit | None:
    """Method of that name, or None."""
    return next((method for method in METHODS if method == text), None)


def rungs(names: Iterable[str]) -> list[tuple[str, ...]]:
    """Names grouped by their models' number of parameters, fewest first; else in their order."""
    ordered = sorted(names, key=_size)
    return [tuple(rung) for _, rung in groupby(ordered, key=_size)]


def _size(name: str) -> int:
    return len(MODELS[name].parameters)


def physics(name: str) -> str:
    """Name of a candidate with "rough" for every method for the rough surface."""
    return "+".join("rough" if term in _ROUGH else term for term in name.split("+"))


def functional_form(name: str) -> str | None:
    """Name of an exact candidate with the functional form instead; None for any other one."""
    terms = name.split("+")
    if _EXACT not in terms:
        return None
    return "+".join(_FUNCTIONAL if term == _EXACT else term for term in terms)


def with_method(names: Iterable[str], method: str) -> tuple[str, ...]:
    """Names with one method for the rough surface in place of all; unchanged for "auto"."""
    if method == "auto":
        return tuple(names)
    own = _BY_METHOD[method]
    made = ("+".join(own if t in _ROUGH else t for t in name.split("+")) for name in names)
    return tuple(dict.fromkeys(made))
