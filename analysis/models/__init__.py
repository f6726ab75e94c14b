"""Reflectance models by name: `MODELS["oren_nayar"].brdf(geometry, albedo=0.9, sigma_deg=30)`.

A sum is written with `+`: `MODELS["oren_nayar+torrance_sparrow"]`; a parameter name that its parts
share (`sigma_deg`) is one parameter of the sum. `fresnel_lobe@30` is the lobe that a polariser
at 30 degrees from the plane of incidence shows. Open `base` first: it defines a `Model`; the other
modules, and those in `rough`, `smooth` and `specular`, hold the formulas.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from functools import cache

from analysis.models.base import Model, Parameter, add
from analysis.models.eon import EON
from analysis.models.lambert import LAMBERT
from analysis.models.minnaert import MINNAERT
from analysis.models.rough.oren_nayar import OREN_NAYAR, OREN_NAYAR_QUALITATIVE
from analysis.models.rough.oren_nayar_exact import OREN_NAYAR_EXACT
from analysis.models.single_scattering import SINGLE_SCATTERING
from analysis.models.smooth.fresnel_lobe import FRESNEL_LOBE, lobe_through_polariser
from analysis.models.smooth.wolff import WOLFF
from analysis.models.smooth.wolff_oren_nayar import WOLFF_OREN_NAYAR
from analysis.models.specular.beckmann_spizzichino import BECKMANN_SPIZZICHINO
from analysis.models.specular.ggx import GGX, GGX_F90
from analysis.models.specular.spike_and_lobe import SPIKE_AND_LOBE
from analysis.models.specular.torrance_sparrow import TORRANCE_SPARROW, TORRANCE_SPARROW_LOBE
from analysis.models.specular.unified import UNIFIED
from analysis.models.weighted_interreflection import OREN_NAYAR_WEIGHTED

__all__ = ["MODELS", "Model", "Parameter"]

_ALL = (
    LAMBERT,
    MINNAERT,
    OREN_NAYAR_QUALITATIVE,
    OREN_NAYAR,
    OREN_NAYAR_EXACT,
    OREN_NAYAR_WEIGHTED,
    EON,
    WOLFF,
    WOLFF_OREN_NAYAR,
    TORRANCE_SPARROW,
    TORRANCE_SPARROW_LOBE,
    FRESNEL_LOBE,
    BECKMANN_SPIZZICHINO,
    SPIKE_AND_LOBE,
    UNIFIED,
    GGX,
    GGX_F90,
    SINGLE_SCATTERING,
)
_SINGLE = {m.name: m for m in _ALL}


class _Models(Mapping[str, Model]):
    """Read-only mapping name -> model; iterates the single models and accepts any sum of them."""

    def __getitem__(self, name: str) -> Model:
        """Return the model or sum of that name. Raises `KeyError` that lists the known ones."""
        return _named(name)

    def __iter__(self) -> Iterator[str]:
        return iter(_SINGLE)

    def __len__(self) -> int:
        return len(_SINGLE)


@cache
def _named(name: str) -> Model:
    parts = name.split("+")
    single = {part: _single(part) for part in parts}
    unknown = [part for part, model in single.items() if model is None]
    if unknown:
        near = get_close_matches(unknown[0].lower().replace("-", "_"), _SINGLE, n=1)
        meant = f"did you mean {near[0]}? " if near else ""
        raise KeyError(
            f"unknown model {unknown[0]!r} in {name!r}; {meant}known: {', '.join(_SINGLE)}, "
            "and their sums, written with +"
        )
    if len(set(parts)) < len(parts):
        raise KeyError(f"a model stands twice in {name!r}; allowed: each model once in a sum")
    found = [model for model in single.values() if model is not None]
    return found[0] if len(found) == 1 else add(*found)


def _single(name: str) -> Model | None:
    """Model of one name, also of a lobe through a polariser: `fresnel_lobe@30`."""
    lobe, at, angle = name.partition("@")
    if at and lobe == FRESNEL_LOBE.name:
        return lobe_through_polariser(angle)
    return _SINGLE.get(name)


MODELS: Mapping[str, Model] = _Models()
