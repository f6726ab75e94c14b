"""Relative error of the printed forms against the exact integral.

What to use when: `form_error` for the error of Lambert's law, the qualitative form (36) or the
functional form (33) + (34) in a scene, without integrating.

Largest angles of lamp and camera from the normal (degrees), at any azimuth and albedo, up to which
a form keeps within 1, 5 and 20 % of the integral; "-" is nowhere:

=====  ===========  ================  ====================
sigma  Lambert      qualitative (36)  functional (33)+(34)
=====  ===========  ================  ====================
2      69, 80, 85   71, 80, 85        75, 81, 85
5      28, 66, 77   -, 68, 78         28, 73, 79
10     -, 37, 64    -, 51, 67         -, 43, 74
20     -, -, 33     -, -, 50          -, 24, 70
30     -, -, -      -, -, 37          -, 25, 73
45     -, -, -      -, -, 25          -, 11, 66
60     -, -, -      -, -, 21          -, 4, 53
=====  ===========  ================  ====================

Source: M. Oren, S. K. Nayar, International Journal of Computer Vision 14 (1995), section 4.4, where
the forms are fitted to the integral.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analysis.models.lambert import ALBEDO, DARKEST, lambert_brdf
from analysis.models.rough.form_error_table import LIMIT_DEG, tabulated_brdf
from analysis.models.rough.oren_nayar_forms import (
    SIGMA_DEG,
    oren_nayar_brdf,
    oren_nayar_qualitative_brdf,
)
from instrument.geometry import FloatArray, Geometry

_FORMS: dict[str, Callable[[Geometry, float, float], FloatArray]] = {
    "lambert": lambda geometry, albedo, _: lambert_brdf(geometry, albedo),
    "oren_nayar_qualitative": oren_nayar_qualitative_brdf,
    "oren_nayar": oren_nayar_brdf,
}


def form_error(name: str, geometry: Geometry, albedo: float, sigma_deg: float) -> FloatArray:
    """Signed relative error of the form called `name` against the integral (0.05: 5 % too high).

    Of the geometry's shape. Infinite beyond LIMIT_DEG, where the table ends. Raises `ValueError`
    for an unknown form, and for an albedo or sigma outside the table.
    """
    if name not in _FORMS:
        raise ValueError(f"form = {name!r}; allowed: {', '.join(_FORMS)}")
    albedo = max(ALBEDO.check(albedo), DARKEST)
    SIGMA_DEG.check(sigma_deg)
    found = _FORMS[name](geometry, albedo, sigma_deg)
    error = found / tabulated_brdf(geometry, albedo, sigma_deg) - 1
    beyond = np.maximum(geometry.theta_i_deg, geometry.theta_r_deg) > LIMIT_DEG
    return np.where(beyond, np.inf, error)
