"""Torrance and Sparrow's lobe whose facets reflect by Fresnel, also through a polariser.

What to use when: `fresnel_lobe` where every facet is a smooth dielectric and its index is asked
for; `fresnel_lobe@A` where a polariser stands before the camera, A degrees from the plane of
incidence, and lamp and camera lie in one plane with the normal. No strength of its own: the index
and the angle of the facets state it.

A lamp without polarisation puts half of its light into each direction; a polariser at A passes
cos^2 A of that in the plane of incidence and sin^2 A of that across it, and half of the light of
a body or a white tile that depolarises. Relative to the tile the body therefore stays as it is,
and the lobe has 1991 (42) with h = cos^2 A, v = sin^2 A; without a polariser h = v = 1/2.

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, "Surface Reflection: Physical and Geometrical
Perspectives", IEEE Transactions on Pattern Analysis and Machine Intelligence 13 (1991), equations
(40)-(45), of which the law of Malus gives h.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.smooth.fresnel import polarised, polarised_by_index
from analysis.models.specular.torrance_sparrow import (
    LOBE_SIGMA_DEG,
    local_incidence,
    torrance_sparrow_gradient,
)
from analysis.models.validity import GRAZING, both_graze, valid_except, valid_unless_both_graze
from instrument.geometry import BoolArray, FloatArray, Geometry

NAME = "fresnel_lobe"
INDEX = Parameter("index", "1", 1.01, 4.0, 1.5, starts=(1.2, 1.5, 2.0, 3.0))
OUT_OF_PLANE_DEG = 1.0  # of dphi, which axes and tables state to a fraction of that
_WORDS = "a polariser's angle needs lamp, camera and normal in one plane (dphi 0 or 180 degrees)"


def fresnel_lobe_brdf(
    geometry: Geometry, index: float, lobe_sigma_deg: float, *, h: float = 0.5
) -> FloatArray:
    """BRDF F'(theta') G P(theta_a) / (4 cos_i cos_r cos_a) with F' of (42). As in `Model.brdf`.

    `h`: share of the light in the plane of incidence, 0 to 1. Never negative; reciprocal.
    """
    facets = torrance_sparrow_gradient(geometry, 1.0, lobe_sigma_deg)["ks"]
    return np.asarray(polarised(local_incidence(geometry), index, h) * facets)


def fresnel_lobe_gradient(
    geometry: Geometry, index: float, lobe_sigma_deg: float, *, h: float = 0.5
) -> dict[str, FloatArray]:
    """Derivatives of `fresnel_lobe_brdf` by index and width. As in `Model.gradient`."""
    by, theta = torrance_sparrow_gradient(geometry, 1.0, lobe_sigma_deg), local_incidence(geometry)
    return {
        "index": by["ks"] * polarised_by_index(theta, index, h),
        "lobe_sigma_deg": by["sigma_deg"] * polarised(theta, index, h),
    }


def in_plane(geometry: Geometry) -> BoolArray:
    """True, of the geometry's shape, where lamp, camera and normal lie in one plane.

    dphi has no meaning where lamp or camera is at the normal.
    """
    across = np.abs(np.sin(np.radians(geometry.dphi_deg)))
    near = math.sin(math.radians(OUT_OF_PLANE_DEG))
    lesser = np.minimum(np.abs(geometry.theta_i_deg), np.abs(geometry.theta_r_deg))
    return np.asarray((across <= near) | (lesser <= OUT_OF_PLANE_DEG))


def _validity(geometry: Geometry, **_: float) -> Validity:
    """Validity of the lobe, in the plane of incidence only. As in `Model.validity`."""
    return valid_except(geometry, (both_graze(geometry), GRAZING), (~in_plane(geometry), _WORDS))


FRESNEL_LOBE = Model(
    NAME,
    (INDEX, LOBE_SIGMA_DEG),
    fresnel_lobe_brdf,
    fresnel_lobe_gradient,
    valid_unless_both_graze,
)


@cache
def lobe_through_polariser(angle: str) -> Model | None:
    """Return the lobe through a polariser `angle` degrees from the plane of incidence, 0 to 90.

    None for a text that is no such angle.
    """
    try:
        degrees = float(angle)
    except ValueError:
        return None
    if not 0 <= degrees <= 90:
        return None
    h = math.cos(math.radians(degrees)) ** 2
    return Model(
        f"{NAME}@{angle}",
        FRESNEL_LOBE.parameters,
        partial(fresnel_lobe_brdf, h=h),
        partial(fresnel_lobe_gradient, h=h),
        _validity,
    )


def out_of_plane(names: Sequence[str], geometry: Geometry) -> str | None:
    """Return why models of these names have no meaning at a geometry, None where they have.

    The geometry has any shape; its angles are in degrees.
    """
    through = [name for name in names if f"{NAME}@" in name]
    within = in_plane(geometry)
    if not through or np.all(within):
        return None
    return (
        f"{through[0]}: {np.count_nonzero(~within)} of {within.size} points lie out of plane; "
        f"{_WORDS}: leave them out, or use {NAME}"
    )
