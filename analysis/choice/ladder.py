"""Candidate models of the automatic choice, in order of complexity from Lambert's law up.

Methods for the same physics are ordered by cost: of those that the data cannot distinguish, the
first is taken. LADDER has the papers' models of up to three parameters. Only where none explains
the data are those of RICH tried, with up to five: gloss with a width of its own or without
Fresnel's law, and light scattered inside.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, get_args

MethodOfFit = Literal["auto", "qualitative", "functional", "exact"]
"""Method for the BRDF of the rough surface; auto: the cheapest that is accurate enough."""

LADDER = (
    "lambert",
    "oren_nayar_qualitative",
    "oren_nayar",
    "oren_nayar_exact",
    "wolff",
    "lambert+torrance_sparrow",
    "oren_nayar_qualitative+torrance_sparrow",
    "oren_nayar+torrance_sparrow",
    "oren_nayar_exact+torrance_sparrow",
)

RICH = (
    "wolff+ggx",
    "minnaert+single_scattering",
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
