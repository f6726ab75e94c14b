"""GGX: mirror facets with the long-tailed slope distribution of Trowbridge and Reitz.

What to use when: `ggx` for a glossy lobe with a wide halo, or a comparison with renderers;
`ggx_f90` for measured surfaces whose gloss at grazing stays below 1 or exceeds it, as that of
coated, woven or layered ones does. The papers' own lobe is `torrance_sparrow`.

Sources: T. S. Trowbridge, K. P. Reitz, Journal of the Optical Society of America 65 (1975); B.
Walter, S. R. Marschner, H. Li, K. E. Torrance, "Microfacet Models for Refraction through Rough
Surfaces", EGSR (2007), equations (20), (33), (34); E. Heitz, "Understanding the Masking-Shadowing
Function in Microfacet-Based BRDFs", Journal of Computer Graphics Techniques 3 (2014), equation
(99); C. Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", Computer Graphics
Forum 13 (1994); S. Lagarde, C. de Rousiers, "Moving Frostbite to Physically Based Rendering",
SIGGRAPH course notes (2014), for f90.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter, Validity, cached_per_geometry
from analysis.models.specular.torrance_sparrow import tangential_squared
from analysis.models.validity import GRAZING, both_graze, valid_except, valid_unless_both_graze
from instrument.geometry import FloatArray, Geometry

F0 = Parameter("f0", "1", 0.0, 1.0, 0.04, scale=True)
# A lobe narrower than this is a mirror image of the lamp, which no BRDF describes.
ALPHA = Parameter("alpha", "1", 0.001, 1.0, 0.3)
# Above 1 it is the strength of a forward lobe, not a reflectance of facets.
F90 = Parameter("f90", "1", 0.0, 10.0, 1.0, scale=True)


def ggx_brdf(geometry: Geometry, f0: float, alpha: float) -> FloatArray:
    """GGX BRDF: F G2 D / (4 cos_i cos_r). Arguments and result as in `Model.brdf`.

    F = f0 + (1 - f0)(1 - cos theta')^5 (Schlick's), theta' from the half-vector to the lamp;
    D = alpha^2 / (pi (alpha^2 cos_a^2 + sin_a^2)^2), theta_a the half-vector's angle;
    G2 = 2 cos_i cos_r / (cos_i q_r + cos_r q_i) with q = sqrt(cos^2 + alpha^2 sin^2), Smith's
    masking and shadowing correlated by height. D falls to a half at tan(theta_a) = 0.64 alpha
    (for small alpha). One bounce only: reflects less than it receives. Never negative;
    reciprocal. It grows without limit only where lamp and camera both graze the surface.
    """
    return ggx_f90_brdf(geometry, f0, 1.0, alpha)


def ggx_gradient(geometry: Geometry, f0: float, alpha: float) -> dict[str, FloatArray]:
    """Derivatives of `ggx_brdf` by f0 and by alpha. As in `Model.gradient`."""
    cos2_a, cos_half, D, visibility = _factors(geometry, alpha)
    schlick = np.power(1 - cos_half, 5)
    c_i, c_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    q_i, q_r = _q(geometry.theta_i, alpha), _q(geometry.theta_r, alpha)
    # dq/dalpha = alpha sin^2/q; D = alpha^2/(pi w^2), so w = alpha/sqrt(pi D).
    dq_i, dq_r = (alpha * np.sin(t) ** 2 for t in (geometry.theta_i, geometry.theta_r))
    log_visibility = -(c_i * dq_r / q_r + c_r * dq_i / q_i) * 2 * visibility
    log_D = 2 / alpha - 4 * cos2_a * np.sqrt(np.pi * D)
    F = f0 + (1 - f0) * schlick
    return {
        "f0": np.asarray((1 - schlick) * D * visibility),
        "alpha": np.asarray(F * D * visibility * (log_D + log_visibility)),
    }


def ggx_f90_brdf(geometry: Geometry, f0: float, f90: float, alpha: float) -> FloatArray:
    """As `ggx_brdf`, with F = f0 + (f90 - f0)(1 - cos theta')^5.

    Arguments and result as in `Model.brdf`. f0 and f90 are the lobe's strengths at normal incidence
    and at grazing. Above 1 more light may leave than arrives. Never negative; reciprocal.
    """
    _, cos_half, D, visibility = _factors(geometry, alpha)
    F = f0 + (f90 - f0) * np.power(1 - cos_half, 5)
    return np.asarray(F * D * visibility)


def ggx_f90_gradient(
    geometry: Geometry, f0: float, f90: float, alpha: float
) -> dict[str, FloatArray]:
    """Derivatives of `ggx_f90_brdf` by f0, f90 and alpha. As in `Model.gradient`."""
    mirrors = ggx_gradient(geometry, 1.0, alpha)["alpha"]  # of facets that reflect all light
    _, cos_half, D, visibility = _factors(geometry, alpha)
    schlick = np.power(1 - cos_half, 5)
    return {
        "f0": np.asarray((1 - schlick) * D * visibility),
        "f90": np.asarray(schlick * D * visibility),
        "alpha": np.asarray((f0 + (f90 - f0) * schlick) * mirrors),
    }


def ggx_f90_validity(geometry: Geometry, f0: float, f90: float, alpha: float) -> Validity:
    """Valid for f0 and f90 up to 1, unless both directions graze. Arguments as in `Model.brdf`."""
    del alpha  # validity does not depend on it
    return valid_except(
        geometry,
        (both_graze(geometry), GRAZING),
        (max(f0, f90) > 1, "a strength above 1: facets would reflect more than they receive"),
    )


def _factors(
    geometry: Geometry, alpha: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """cos^2(theta_a), cos(theta'), D in 1/sr, and G2/(4 cos_i cos_r)."""
    cos2_a, sin2_a, cos_half = _half_vector(geometry)
    D = np.square(alpha / (alpha * alpha * cos2_a + sin2_a)) / np.pi
    c_i, c_r = np.cos(geometry.theta_i), np.cos(geometry.theta_r)
    q_i, q_r = _q(geometry.theta_i, alpha), _q(geometry.theta_r, alpha)
    return cos2_a, cos_half, D, 0.5 / (c_i * q_r + c_r * q_i)


@cached_per_geometry
def _half_vector(geometry: Geometry) -> tuple[FloatArray, ...]:
    """cos^2(theta_a), sin^2(theta_a) and cos(theta')."""
    across2 = tangential_squared(geometry)
    along2 = np.square(np.cos(geometry.theta_i) + np.cos(geometry.theta_r))
    length2 = across2 + along2
    cos_half = np.minimum(np.sqrt(length2) / 2, 1.0)
    return along2 / length2, across2 / length2, cos_half


def _q(theta: FloatArray, alpha: float) -> FloatArray:
    return np.asarray(np.sqrt(np.square(np.cos(theta)) + np.square(alpha * np.sin(theta))))


GGX = Model("ggx", (F0, ALPHA), ggx_brdf, ggx_gradient, valid_unless_both_graze)
GGX_F90 = Model("ggx_f90", (F0, F90, ALPHA), ggx_f90_brdf, ggx_f90_gradient, ggx_f90_validity)
