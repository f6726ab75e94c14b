"""The candidates among which the program chooses, from Lambert's law up.

Methods for the same physics stand in the order of their cost: of those that the data cannot tell
apart the first is taken. What the papers' own models of up to three parameters explain needs no
more; only where they do not are the RICH ones tried, of up to five: a gloss of its own width, one
that does not follow Fresnel, light scattered inside.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

MethodOfFit = Literal["auto", "qualitative", "functional", "exact"]
"""How a fit works out the rough surface; auto: as cheaply as the data allow."""

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

# Predictions that differ less than this part of u are the same for all that they serve.
SAME_PREDICTION = 1 / 3

# The rough diffuse surface by rising cost: one physics, three methods.
_ROUGH = ("oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact")
_EXACT, _FUNCTIONAL = "oren_nayar_exact", "oren_nayar"
_OF_METHOD = {
    "qualitative": "oren_nayar_qualitative", "functional": _FUNCTIONAL, "exact": _EXACT,
}  # fmt: skip
METHODS: tuple[MethodOfFit, ...] = ("auto", "qualitative", "functional", "exact")


def physics(name: str) -> str:
    """The candidate's name with all methods for one physics called alike."""
    return "+".join("rough" if term in _ROUGH else term for term in name.split("+"))


def approximation(name: str) -> str | None:
    """The functional form of a candidate that integrates; None if it does not."""
    terms = name.split("+")
    if _EXACT not in terms:
        return None
    return "+".join(_FUNCTIONAL if term == _EXACT else term for term in terms)


def of_method(names: Iterable[str], method: str) -> tuple[str, ...]:
    """Candidates with the rough surface worked out by one method alone; "auto": all as they are."""
    if method == "auto":
        return tuple(names)
    own = _OF_METHOD[method]
    made = ("+".join(own if t in _ROUGH else t for t in name.split("+")) for name in names)
    return tuple(dict.fromkeys(made))
