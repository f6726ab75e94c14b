"""V-cavities: one facet, the single-slope surface, and the isotropic single-slope surface.

What to use when: `attenuation`, `interreflection_factor` and `projected_radiance` for one facet,
as printed; `unidirectional_single_slope` for a grooved surface; `isotropic_single_slope` for facets
of one slope in all azimuths, fast and exact (`analysis.models.rough.oren_nayar_exact` averages it
over slopes). All but the last are library only.

Angles are in radians; theta_i, phi_i point to the lamp, theta_r, phi_r to the camera, theta_a,
phi_a along the facet's normal; phi = 0 is one azimuth for all. Arguments are scalars or arrays that
broadcast to the result's shape; a theta outside 0 to pi/2 is a `ValueError`. A radiance is given as
its two parts, `(direct, twice)`, over E0 cos(theta_i):

    L / (E0 cos theta_i) = (albedo / pi) direct + (albedo^2 / pi) twice      in 1/sr.

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), sections 4.1 and 4.2, appendix A.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from analysis.models.validity import polar
from instrument.geometry import FloatArray, IntArray

_HALF_WIDTHS, _SHARES = (0.01, 0.3), (0.5, 0.8, 1.0)  # of panels, and of the nodes they need
_CHUNK = 8192  # nodes at a time: their arrays stay in the processor's cache
_TINY = 1e-300  # avoids 0 / 0


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
    sa, va = _to_lamp(towards, theta_a, phi_a), _to_camera(towards, theta_a, phi_a)
    lit = _quotient(2 * np.cos(towards.theta_i) * np.cos(theta_a), sa)
    seen = _quotient(2 * np.cos(towards.theta_r) * np.cos(theta_a), va)
    return np.clip(np.minimum(lit, seen), 0.0, 1.0)


def critical_angle(theta: FloatArray, theta_a: FloatArray) -> FloatArray:
    """Critical azimuth phi_c of (39) in radians, for a lamp or a camera at theta.

    Both arguments in radians, broadcast. Table 2: facets within phi_c of the lamp's azimuth are
    partly shadowed, those within phi_c of the opposite one turn away from it; likewise masking and
    the camera. 0 where no facet is.
    """
    return _critical(np.tan(polar("theta", theta)) * np.tan(polar("theta_a", theta_a)))


def masked_width(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """m_v / w of (20), 0 to 1: the part of the facet, from the groove up, hidden from the camera.

    Angles in radians; all arguments broadcast. Erratum: printed as "visible"; the integral (23)
    starts at it. 1 where the facet turns away.
    """
    va, va_other = (_to_camera(towards, theta_a, phi) for phi in (phi_a, phi_a + np.pi))
    return np.where(va > 0, np.clip(-_quotient(va_other, va), 0.0, 1.0), 1.0)


def shadowed_width(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> FloatArray:
    """m^s / w of (21), 0 to 1: the part of the ADJACENT facet that lies in shadow.

    Angles in radians; all arguments broadcast. Erratum: printed as "illuminated". 1 where that
    facet turns away from the lamp.
    """
    sa, sa_other = (_to_lamp(towards, theta_a, phi) for phi in (phi_a, phi_a + np.pi))
    return np.where(sa_other > 0, np.clip(-_quotient(sa, sa_other), 0.0, 1.0), 1.0)


def interreflection_factor(
    masked: FloatArray, shadowed: FloatArray, theta_a: FloatArray
) -> FloatArray:
    """Interreflection factor (24) of the widths m_v / w and m^s / w; pi (1 - cos) for open facets.

    pi/2 [d(1, m_v) + d(1, m^s) - d(m^s, m_v) - d(1, 1)], with the distances d of (25). `theta_a` in
    radians; all broadcast.
    """

    def d(x: FloatArray | float, y: FloatArray | float) -> FloatArray:
        return np.sqrt(np.maximum(0.0, x * x + 2 * x * y * np.cos(2 * theta_a) + y * y))

    exchanged = d(1.0, masked) + d(1.0, shadowed) - d(shadowed, masked) - d(1.0, 1.0)
    return np.pi / 2 * np.maximum(exchanged, 0.0)  # rounding may make it slightly negative


def projected_radiance(towards: Directions, theta_a: FloatArray, phi_a: FloatArray) -> Radiance:
    """Projected radiance of one facet: (10) times (16), Table 1; and (26). Sum: (27).

    Angles in radians; all arguments broadcast.
    """
    sa, sa_other = (_to_lamp(towards, theta_a, phi) for phi in (phi_a, phi_a + np.pi))
    va = _to_camera(towards, theta_a, phi_a)
    scale = np.cos(theta_a) * np.cos(towards.theta_i) * np.cos(towards.theta_r)
    direct = sa * va * attenuation(towards, theta_a, phi_a) / scale
    factor = interreflection_factor(
        masked_width(towards, theta_a, phi_a), shadowed_width(towards, theta_a, phi_a), theta_a
    )
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


def isotropic_single_slope(
    theta_i: FloatArray,
    theta_r: FloatArray,
    dphi: FloatArray,
    theta_a: FloatArray,
    nodes: int = 32,
) -> Radiance:
    """Radiance of facets of one slope in all azimuths: (29), the mean of (28) over phi_a.

    Angles in radians, of shapes that broadcast; theta_a is below pi/2. The half circle of cavities
    is cut at every kink: the critical angles of shadowing and masking (39), and where the two
    widths are equal. In between, the direct part is a trigonometric polynomial and is integrated in
    closed form; so is the part of two bounces where nothing is hidden. Elsewhere that part is
    integrated by Gauss-Legendre quadrature of `nodes` nodes (4 or more; 10 give 1e-6, 28 give
    1e-8), of 2 nodes - 4 where lamp and camera are both partly hidden, and of fewer on narrow
    pieces. No mixing of azimuths (44).
    """
    if nodes < 4:
        raise ValueError(f"nodes = {nodes}; allowed: 4 or more")
    theta_i, theta_r = polar("theta_i", theta_i), polar("theta_r", theta_r)
    arrays = np.broadcast_arrays(theta_i, theta_r, dphi, polar("theta_a", theta_a))
    shape = arrays[0].shape
    cavities = _Cavities.of(*(np.asarray(x, dtype=np.float64).ravel() for x in arrays))
    panels = _Panels.of(cavities)
    direct, twice = panels.closed(cavities)
    twice += _hidden_twice(cavities, panels, nodes)
    mean = np.cos(cavities.theta_a) / (2 * np.pi)
    # Rounding may make a vanishing part slightly negative.
    direct, twice = np.maximum(direct * mean, 0.0), np.maximum(twice * mean, 0.0)
    return Radiance(direct.reshape(shape), twice.reshape(shape))


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


def _critical(p: FloatArray) -> FloatArray:
    """(39) of the product of the two tangents."""
    return np.arccos(1 / np.maximum(p, 1.0))


class _Cavities(NamedTuple):
    """Cavities of slope theta_a in all azimuths, under a lamp at phi = 0, a camera at dphi.

    `p`, `q`: tan(theta_a) times the tangent of theta_i, of theta_r. A cavity at azimuth phi has
    u_i = p cos(phi) and u_r = q cos(phi - dphi). Both facets of it together, that is (28), are,
    with U = |u|, s the sign of u_i u_r, and over cos(theta_a) / 2:

    =================  ==================  ====================================================
    case               direct              twice
    =================  ==================  ====================================================
    U_i, U_r <= 1      2 (1 + s U_i U_r)   2 (1 - s U_i U_r) (1 - cos)
    U_r <= 1 < U_i     2 (1 + s U_r)       (1 - s U_r) (1 - cos + e_i)
    U_i <= 1 < U_r     2 (1 + s U_i)       (1 - s U_i) (1 - cos + e_r)
    both > 1, s = 1    2 (1 + min(U))      0
    both > 1, s = -1   0                   (1 + U_i) e_r + (1 + U_r) e_i + (U_i U_r - 1) cos - W
    =================  ==================  ====================================================

    This is Table 1, and (26) with (24): in those, 1 - m_v / w = 2 / (1 + U_r) turns d(1, m_v)
    into the square root in e = sqrt(sin^2 + U^2 cos^2) - U cos = sin (sqrt(1 + g^2) - g), with
    g = U / tan(theta_a); and of d(m^s, m_v), W^2 = (U_i U_r - 1)^2 cos^2 + (U_i - U_r)^2 sin^2.
    """

    tan_i: FloatArray
    tan_r: FloatArray
    dphi: FloatArray
    theta_a: FloatArray
    p: FloatArray
    q: FloatArray

    @classmethod
    def of(
        cls, theta_i: FloatArray, theta_r: FloatArray, dphi: FloatArray, theta_a: FloatArray
    ) -> _Cavities:
        tan_i, tan_r, slope = np.tan(theta_i), np.tan(theta_r), np.tan(theta_a)
        return cls(tan_i, tan_r, dphi, theta_a, tan_i * slope, tan_r * slope)

    def chosen(self, at: IntArray) -> _Cavities:
        """Cavities at those indices."""
        return _Cavities(*(values[at] for values in self))

    def swapped(self) -> _Cavities:
        """Lamp and camera exchanged; azimuths then count from where the camera was."""
        return _Cavities(self.tan_r, self.tan_i, -self.dphi, self.theta_a, self.q, self.p)

    def kinks(self) -> FloatArray:
        """Azimuths (7, ...) where a case ends, rising within 0 to pi, then the first plus pi."""
        phi_i, phi_r = _critical(self.p), _critical(self.q)
        cos_dphi, sin_dphi = _cos_sin(self.dphi)
        x, y = self.q * cos_dphi, self.q * sin_dphi
        equal, opposite = np.arctan2(self.p - x, y), np.arctan2(-self.p - x, y)
        kinks = np.empty((7, self.p.size))
        kinks[:6] = -phi_i, phi_i, self.dphi - phi_r, self.dphi + phi_r, equal, opposite
        kinks[:6] -= np.pi * np.floor(kinks[:6] / np.pi)
        kinks[:6].sort(axis=0)
        kinks[6] = kinks[0] + np.pi
        return kinks


class _Panels(NamedTuple):
    """Azimuths between kinks, shape (6, ...): middle, half width, and u, v in the middle.

    v is u with the sine for the cosine. Where |u| exceeds 1 in the middle it does so all over the
    panel.
    """

    middle: FloatArray
    half: FloatArray
    u_i: FloatArray
    u_r: FloatArray
    v_i: FloatArray
    v_r: FloatArray

    @classmethod
    def of(cls, c: _Cavities) -> _Panels:
        kinks = c.kinks()
        middle, half = (kinks[1:] + kinks[:-1]) / 2, (kinks[1:] - kinks[:-1]) / 2
        cos_m, sin_m = _cos_sin(middle)
        cos_r, sin_r = _cos_sin(middle - c.dphi)
        return cls(middle, half, c.p * cos_m, c.q * cos_r, c.p * sin_m, c.q * sin_r)

    def closed(self, c: _Cavities) -> tuple[FloatArray, FloatArray]:
        """Integrals in closed form: the direct part, and two bounces where nothing is hidden."""
        h = self.half
        cosine, sine = _cos_sin(h)
        both = sine * cosine
        uu = self.u_i * self.u_r
        product = uu * (h + both) + self.v_i * self.v_r * (h - both)  # of u_i u_r
        U_i, U_r = np.abs(self.u_i), np.abs(self.u_r)
        smaller = np.copysign(np.minimum(U_i, U_r), uu)
        nothing_hidden = np.maximum(U_i, U_r) <= 1
        hidden = np.where(smaller < -1, 0.0, 2 * (h + smaller * sine))
        direct = np.where(nothing_hidden, 2 * h + product, hidden).sum(axis=0)
        twice = np.where(nothing_hidden, 2 * h - product, 0.0).sum(axis=0)
        return 2 * direct, 2 * _one_minus_cos(c.theta_a) * twice

    def hidden(self) -> tuple[IntArray, IntArray, IntArray]:
        """Flat indices where two bounces are shadowed, masked, and both from opposite sides."""
        dark, unseen = np.abs(self.u_i) > 1, np.abs(self.u_r) > 1
        across = dark & unseen & (self.u_i * self.u_r < 0)
        used = self.half > 0
        shadowed, masked = used & dark & ~unseen, used & unseen & ~dark
        return np.flatnonzero(shadowed), np.flatnonzero(masked), np.flatnonzero(used & across)


def _hidden_twice(c: _Cavities, panels: _Panels, nodes: int) -> FloatArray:
    """Integral of the two-bounce part over the panels that are masked or shadowed."""
    shadowed, masked, across = panels.hidden()
    total = np.zeros(c.p.size)
    for kind, integral, number in (
        (shadowed, _shadowed, nodes),
        (masked, _masked, nodes),
        (across, _across, 2 * nodes - 4),
    ):
        for panel, fewer in _by_width(kind, panels.half.ravel(), number):
            at = panel % c.p.size
            middle, half = panels.middle.ravel()[panel], panels.half.ravel()[panel]
            total += np.bincount(at, integral(c.chosen(at), middle, half, fewer), c.p.size)
    return total


def _by_width(panel: IntArray, half: FloatArray, nodes: int) -> Iterator[tuple[IntArray, int]]:
    """Panels grouped by half width (radians), and the number of nodes that each group needs."""
    size = np.searchsorted(_HALF_WIDTHS, half[panel])
    for n, share in enumerate(_SHARES):
        part, fewer = panel[size == n], max(2, round(share * nodes))
        step = _CHUNK // fewer
        for start in range(0, part.size, step):
            yield part[start : start + step], fewer


def _shadowed(c: _Cavities, middle: FloatArray, half: FloatArray, nodes: int) -> FloatArray:
    """Integral over panels that are shadowed and not masked."""
    return _once_hidden(c, middle, half, nodes)


def _masked(c: _Cavities, middle: FloatArray, half: FloatArray, nodes: int) -> FloatArray:
    """Integral over panels that are masked and not shadowed: lamp and camera exchanged."""
    return _once_hidden(c.swapped(), middle - c.dphi, half, nodes)


def _once_hidden(c: _Cavities, middle: FloatArray, half: FloatArray, nodes: int) -> FloatArray:
    """Integral of (1 - s U_r) (1 - cos + e_i) over panels with U_r <= 1 < U_i."""
    x, w = _clustered(nodes, 1.0)
    cosine, sine = _cos_sin(x[:, None] * half + middle)
    cos_dphi, sin_dphi = _cos_sin(c.dphi)
    u_r = cosine * (c.q * cos_dphi) + sine * (c.q * sin_dphi)
    open_part = 1 - np.copysign(u_r, u_r * cosine)
    g = c.tan_i * np.abs(cosine)
    e = np.sin(c.theta_a) / (np.sqrt(g * g + 1) + g)
    return np.asarray(half * (w @ (open_part * (e + _one_minus_cos(c.theta_a)))))


def _across(c: _Cavities, middle: FloatArray, half: FloatArray, nodes: int) -> FloatArray:
    """Integral of the last case: lit from one side, seen from the other, U_i and U_r > 1."""
    x, w = _clustered(nodes, 2.0)
    cosine, sine = _cos_sin(x[:, None] * half + middle)
    cos_dphi, sin_dphi = _cos_sin(c.dphi)
    cos_a, sin_a, cot_a = np.cos(c.theta_a), np.sin(c.theta_a), 1 / np.tan(c.theta_a)
    U_i = c.p * np.abs(cosine)
    U_r = np.abs(cosine * (c.q * cos_dphi) + sine * (c.q * sin_dphi))
    g_i, g_r = U_i * cot_a, U_r * cot_a
    e_i, e_r = np.sqrt(g_i * g_i + 1) + g_i, np.sqrt(g_r * g_r + 1) + g_r  # sin / e
    V, across2 = (U_i * U_r - 1) * cos_a, np.square((U_i - U_r) * sin_a)
    W = np.sqrt(V * V + across2)
    bounces = sin_a * ((1 + U_i) / e_r + (1 + U_r) / e_i)
    value = bounces - across2 / (W + np.abs(V) + _TINY)  # ... + V - W
    return np.asarray(half * (w @ value))


def _one_minus_cos(theta: FloatArray) -> FloatArray:
    """1 - cos(theta), to full relative precision for small theta."""
    return np.asarray(2 * np.square(np.sin(theta / 2)))


def _cos_sin(angle: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cosine and sine from the tangent of half the angle: one call, in half the time."""
    t = np.tan(angle / 2)
    square = t * t
    scale = 1 / (1 + square)
    return (1 - square) * scale, 2 * t * scale


@cache
def _clustered(nodes: int, k: float) -> tuple[FloatArray, FloatArray]:
    """Gauss-Legendre on -1 to 1, clustered at both ends by tanh(k x) / tanh(k).

    The square roots in the integrands have their branch points just beyond the kinks.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    end = np.tanh(k)
    return np.tanh(k * x) / end, w * k / np.square(np.cosh(k * x)) / end
