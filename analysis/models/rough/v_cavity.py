"""V-cavities as printed: one facet, and the surface of grooves of one slope and one azimuth.

What to use when: `attenuation`, `interreflection_factor` and `projected_radiance` for one facet;
`unidirectional_single_slope` for a grooved surface. All are library only. Facets in all azimuths
are in `analysis.models.rough.single_slope`.

Everything holds up to polar angles of exactly 90 degrees, where the values are the limits.

Angles are in radians; theta_i, phi_i point to the lamp, theta_r, phi_r to the camera, theta_a,
phi_a along the facet's normal; phi = 0 is one azimuth for all. Arguments are scalars or arrays that
broadcast to the result's shape; a theta outside 0 to pi/2 is a `ValueError`. A radiance is given as
its two parts, `(direct, twice)`, over E0 cos(theta_i):

    L / (E0 cos theta_i) = (albedo / pi) direct + (albedo^2 / pi) twice      in 1/sr.

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), sections 4.1 and 4.2, appendix A.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.models.validity import polar
from instrument.geometry import FloatArray


class Radiance(NamedTuple):
    """Light of one bounce per albedo / pi, and of two bounces per albedo^2 / pi."""

    direct: FloatArray
    twice: FloatArray


class Directions(NamedTuple):
    """To the lamp (theta_i, phi_i) and to the camera (theta_r, phi_r), in radians."""

    theta_i: FloatArray
    phi_i: FloatArray
    theta_r: FloatArray
    phi_r: FloatArray


def attenuation(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """Geometric attenuation factor (16), 0 to 1: the part of the facet that is both lit and seen.

    Max[0, Min[1, 2<s,n><a,n>/<s,a>, 2<v,n><a,n>/<v,a>]]: the three cases of Table 1, and 0 where
    the facet turns away from the lamp or the camera. The order of Max and Min is footnote 6's.
    Angles in radians; all arguments broadcast.
    """
    lit = _reached(towards.theta_i, theta_a, _to_lamp(towards, theta_a, phi_a))
    return np.minimum(lit, _seen(towards, theta_a, phi_a))


def critical_angle(theta: FloatArray, theta_a: FloatArray) -> FloatArray:
    """Critical azimuth phi_c of (39) in radians, for a lamp or a camera at theta.

    Both arguments in radians, broadcast. Table 2: facets within phi_c of the lamp's azimuth are
    partly shadowed, those within phi_c of the opposite one turn away from it; likewise masking and
    the camera. 0 where no facet is.
    """
    p = np.tan(polar("theta", theta)) * np.tan(polar("theta_a", theta_a))
    return np.asarray(np.arccos(1 / np.maximum(p, 1.0)))


def masked_width(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """m_v / w of (20), 0 to 1: the part of the facet, from the groove up, hidden from the camera.

    Angles in radians; all arguments broadcast. Erratum: printed as "visible"; the integral (23)
    starts at it. 1 where the facet turns away.
    """
    return 1 - _seen(towards, theta_a, phi_a)


def shadowed_width(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """m^s / w of (21), 0 to 1: the part of the ADJACENT facet that lies in shadow.

    Angles in radians; all arguments broadcast. Erratum: printed as "illuminated". 1 where that
    facet turns away from the lamp.
    """
    return 1 - _lit_opposite(towards, theta_a, phi_a)


def interreflection_factor(
    masked: FloatArray, shadowed: FloatArray, theta_a: FloatArray
) -> FloatArray:
    """Interreflection factor (24) of the widths m_v / w and m^s / w; pi (1 - cos) for open facets.

    pi/2 [d(1, m_v) + d(1, m^s) - d(m^s, m_v) - d(1, 1)], with the distances d of (25). `theta_a` in
    radians; all broadcast.
    """
    return _exchange(np.asarray(1 - masked), np.asarray(1 - shadowed), theta_a)


def projected_radiance(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> Radiance:
    """Projected radiance of one facet: (10) times (16), Table 1; and (26). Sum: (27).

    Angles in radians; all arguments broadcast.
    """
    sa, sa_other = (_to_lamp(towards, theta_a, phi) for phi in (phi_a, phi_a + np.pi))
    va = _to_camera(towards, theta_a, phi_a)
    scale = np.cos(theta_a) * np.cos(towards.theta_i) * np.cos(towards.theta_r)
    direct = sa * va * attenuation(towards, theta_a, phi_a) / scale
    seen, lit = _seen(towards, theta_a, phi_a), _lit_opposite(towards, theta_a, phi_a)
    factor = _exchange(seen, lit, theta_a)
    twice = np.maximum(sa_other, 0.0) * np.maximum(va, 0.0) * factor / (np.pi * scale)
    return Radiance(direct, twice)


def unidirectional_single_slope(
    towards: Directions, theta_a: FloatArray, phi_a: FloatArray
) -> Radiance:
    """Radiance of grooves of one slope and one azimuth: (28), the mean of their two facets.

    Angles in radians; all arguments broadcast.
    """
    one = projected_radiance(towards, theta_a, phi_a)
    other = projected_radiance(towards, theta_a, phi_a + np.pi)
    return Radiance((one.direct + other.direct) / 2, (one.twice + other.twice) / 2)


def _seen(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """1 - m_v / w: the part of the facet that the camera sees."""
    return _reached(towards.theta_r, theta_a, _to_camera(towards, theta_a, phi_a))


def _lit_opposite(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """1 - m^s / w: the part of the adjacent facet that the lamp lights."""
    return _reached(towards.theta_i, theta_a, _to_lamp(towards, theta_a, phi_a + np.pi))


def _reached(theta: FloatArray, theta_a: FloatArray, cosine: FloatArray) -> FloatArray:
    """Part of a facet that rays from theta reach, 2 <s,n><a,n>/<s,a>, 0 to 1; cosine: <s,a>.

    To full relative precision at grazing angles, where all but 1e-16 of the facet is hidden.
    """
    part = _quotient(2 * np.cos(theta) * np.cos(theta_a), cosine)
    return np.where(cosine > 0, np.clip(part, 0.0, 1.0), 0.0)


def _exchange(seen: FloatArray, lit: FloatArray, theta_a: FloatArray) -> FloatArray:
    """(24) of the seen and the lit part, its zeros at seen = 0 and at lit = 0 as factors.

    From (24) by x - y = (x^2 - y^2) / (x + y), applied twice.
    """
    cos2, four = np.cos(2 * theta_a), 4 * np.square(np.cos(theta_a))
    m, s = 1 - seen, 1 - lit

    def d(one: FloatArray | float, other: FloatArray | float) -> FloatArray:
        return np.sqrt(np.square(one - other) + four * one * other + 1e-300)

    d_11, d_1m, d_1s, d_sm = d(1.0, 1.0), d(1.0, m), d(1.0, s), d(s, m)
    more = (four - seen) / (d_11 + d_1m) + (2 - seen + 2 * s * cos2) / (d_1s + d_sm)
    bracket = (four - lit) / (d_11 + d_1s) * more - 2 * cos2
    return np.asarray(np.pi / 2 * seen * lit * np.maximum(bracket, 0.0) / (d_1m + d_sm))


def _to_lamp(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """<s, a>."""
    theta_i, theta_a = polar("theta_i", towards.theta_i), polar("theta_a", theta_a)
    return _cosine(theta_i, towards.phi_i, theta_a, phi_a)


def _to_camera(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """<v, a>."""
    theta_r, theta_a = polar("theta_r", towards.theta_r), polar("theta_a", theta_a)
    return _cosine(theta_r, towards.phi_r, theta_a, phi_a)


def _cosine(
    theta: FloatArray, phi: FloatArray, theta_a: FloatArray, phi_a: FloatArray
) -> FloatArray:
    """Cosine of the angle between two directions."""
    return np.asarray(
        np.cos(theta) * np.cos(theta_a) + np.sin(theta) * np.sin(theta_a) * np.cos(phi - phi_a)
    )


def _quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Quotient; +-infinity for division by zero, without a warning."""
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        return np.asarray(numerator / denominator)
