"""Isotropic single-slope surface: facets of one slope in all azimuths, averaged exactly (29).

A cavity of slope theta_a at azimuth phi, seen from a first direction at azimuth 0 and a second one
at azimuth dphi, has u_1 = p cos(phi) and u_2 = q cos(phi - dphi), where p and q are tan(theta_a)
times the tangents of the two polar angles. Its two facets together, that is (28), are, with
x = |u_1|, y = |u_2|, s the sign of u_1 u_2, and over cos(theta_a) / 2:

=================  =================  ====================================================
case               direct             twice
=================  =================  ====================================================
x, y <= 1          2 (1 + s x y)      2 (1 - s x y) (1 - cos)
y <= 1 < x         2 (1 + s y)        (1 - s y) (1 - cos + e_1)
x <= 1 < y         2 (1 + s x)        (1 - s x) (1 - cos + e_2)
both > 1, s = 1    2 (1 + min(x, y))  0
both > 1, s = -1   0                  (1 + x) e_2 + (1 + y) e_1 + (x y - 1) cos - W
=================  =================  ====================================================

This is Table 1, and (26) with (24): in those, 1 - m_v / w = 2 / (1 + y) turns d(1, m_v) into the
square root in e = sqrt(sin^2 + x^2 cos^2) - x cos = sin (sqrt(1 + g^2) - g), g = x / tan(theta_a);
and of d(m^s, m_v), W^2 = (x y - 1)^2 cos^2 + (x - y)^2 sin^2. A direction is called hidden where
its |u| exceeds 1: lamp or camera does not reach the whole facet. The surface is reciprocal, so the
first direction is the more oblique one, be it that of the lamp or of the camera: p >= q.

The half circle of azimuths is cut where a case ends: the critical angles (39), cos(phi_1) = 1 / p
and cos(phi_2) = 1 / q, and where x = y. All but e_1, e_2 and W is integrated in closed form; these
by Gauss-Legendre quadrature in v = tan(phi / 2). Differences of nearly equal numbers are written as
products, so that everything holds up to polar angles of exactly 90 degrees, where p is 1e16.

Source: M. Oren, S. K. Nayar, International Journal of Computer Vision 14 (1995), section 4.2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.models.rough.azimuth_arcs import (
    OnceHiddenArcs,
    TwiceHiddenArcs,
    once_hidden,
    twice_hidden,
)
from analysis.models.rough.v_cavity import Radiance
from analysis.models.validity import polar
from instrument.geometry import BoolArray, FloatArray, IntArray

_BLOCK = 16384  # slopes at a time


class DirectionPairs(NamedTuple):
    """Pairs of directions (N,), the more oblique one first; angles in radians, dphi 0 to pi.

    Where u_1 = u_2, phi = pi / 2 - `equal`; there u_2 - u_1 has the gradient `steepness` times
    tan(theta_a). Where u_1 = -u_2, tan(phi / 2) = -`v_opposite`.
    """

    tan_1: FloatArray
    tan_2: FloatArray
    dphi: FloatArray
    cos_dphi: FloatArray
    sin_dphi: FloatArray
    cos_half: FloatArray
    sin_half: FloatArray
    equal: FloatArray
    steepness: FloatArray
    v_opposite: FloatArray

    @classmethod
    def of(cls, larger: FloatArray, smaller: FloatArray, dphi: FloatArray) -> DirectionPairs:
        """Pairs of polar angles `larger` and `smaller` and azimuth dphi, (N,) each, in radians."""
        tan_1, tan_2 = np.tan(larger), np.tan(smaller)
        cosine, sine = np.cos(dphi), np.sin(dphi)
        along, across, sum_along = tan_1 - tan_2 * cosine, tan_2 * sine, tan_1 + tan_2 * cosine
        half = (np.cos(dphi / 2), np.sin(dphi / 2))
        v_opposite = sum_along / np.maximum(np.hypot(across, sum_along) + across, 1e-300)
        equal, steepness = np.arctan2(across, along), np.hypot(along, across)
        return cls(tan_1, tan_2, dphi, cosine, sine, *half, equal, steepness, v_opposite)

    def chosen(self, at: IntArray) -> DirectionPairs:
        """Pairs at those indices (M,)."""
        return DirectionPairs(*(values.take(at) for values in self))


class _Facets(NamedTuple):
    """Slopes (M,) with the cosine and sine of theta_a, 1 - cos, and p, q."""

    pairs: DirectionPairs
    cosine: FloatArray
    sine: FloatArray
    one_minus_cos: FloatArray
    p: FloatArray
    q: FloatArray


def isotropic_single_slope(
    theta_i: FloatArray,
    theta_r: FloatArray,
    dphi: FloatArray,
    theta_a: FloatArray,
    nodes: int = 32,
) -> Radiance:
    """Radiance of facets of one slope in all azimuths: (29), the mean of (28) over phi_a.

    Angles in radians, of shapes that broadcast. Direct light is exact to rounding; light of two
    bounces has about `nodes` nodes (4 or more) per arc of azimuths. No mixing of azimuths (44).
    """
    if nodes < 4:
        raise ValueError(f"nodes = {nodes}; allowed: 4 or more")
    theta_i, theta_r = polar("theta_i", theta_i), polar("theta_r", theta_r)
    arrays = np.broadcast_arrays(theta_i, theta_r, dphi, polar("theta_a", theta_a))
    i, r, turn, slope = (np.asarray(x, dtype=np.float64).ravel() for x in arrays)
    turn = np.abs(turn - 2 * np.pi * np.round(turn / (2 * np.pi)))
    pairs = DirectionPairs.of(np.maximum(i, r), np.minimum(i, r), turn)
    direct, twice = mean_over_azimuths(pairs, np.arange(slope.size), slope, nodes)
    return Radiance(direct.reshape(arrays[0].shape), twice.reshape(arrays[0].shape))


def mean_over_azimuths(
    pairs: DirectionPairs, at: IntArray, theta_a: FloatArray, nodes: int
) -> tuple[FloatArray, FloatArray]:
    """As `isotropic_single_slope` for slopes theta_a (M,), each with the pair of its index `at`."""
    direct, twice = np.empty(at.size), np.empty(at.size)
    for start in range(0, at.size, _BLOCK):
        part = slice(start, start + _BLOCK)
        direct[part], twice[part] = _mean(pairs, at[part], theta_a[part], nodes)
    return direct, twice


def _mean(
    pairs: DirectionPairs, at: IntArray, theta_a: FloatArray, nodes: int
) -> tuple[FloatArray, FloatArray]:
    half = np.tan(theta_a / 2)
    scale = 1 / (1 + half * half)
    cosine, sine, one_minus_cos = (
        (1 - half * half) * scale,
        2 * half * scale,
        2 * half * half * scale,
    )
    slope = 2 * half / (1 - half * half)
    p, q = pairs.tan_1.take(at) * slope, pairs.tan_2.take(at) * slope
    product = p * q * pairs.cos_dphi.take(at)
    direct, twice = np.pi * (2 + product), one_minus_cos * np.pi * (2 - product)
    for index, integrals in (
        (np.flatnonzero((p > 1) & (q <= 1)), _first_hidden),
        (np.flatnonzero(q > 1), _both_hidden),
    ):
        few = (values.take(index) for values in (cosine, sine, one_minus_cos, p, q))
        facets = _Facets(pairs.chosen(at[index]), *few)
        direct[index], twice[index] = integrals(facets, nodes)
    mean = cosine / (2 * np.pi)  # rounding may make a vanishing part slightly negative
    return np.maximum(direct * mean, 0.0), np.maximum(twice * mean, 0.0)


def _critical(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine of the critical angle phi (39), cos(phi) = 1 / p, and tan(phi / 2)."""
    return np.sqrt((1 - 1 / p) * (1 + 1 / p)), np.sqrt((p - 1) / (p + 1))


def _seen_whole(f: _Facets, psi: FloatArray, sin_1: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Closed parts of both integrals, were the second direction nowhere hidden.

    psi = pi / 2 - phi_1 is half the arc where the first direction is not hidden.
    """
    along = f.q * f.pairs.cos_dphi
    product = 2 * f.p * along * (psi - sin_1 / f.p)  # 2 x the integral of u_1 u_2 over that arc
    turned = 2 * along * sin_1  # integral of s y over the other one
    hidden = np.pi - 2 * psi
    direct = 4 * psi + product + 2 * (hidden + turned)
    return direct, f.one_minus_cos * (4 * psi - product + hidden - turned)


def _first_hidden(f: _Facets, nodes: int) -> tuple[FloatArray, FloatArray]:
    """Both integrals over the half circle where q <= 1 < p."""
    sin_1, v_1 = _critical(f.p)
    direct, twice = _seen_whole(f, np.arcsin(1 / f.p), sin_1)
    none, every = np.zeros(f.p.size), np.arange(f.p.size)
    half = OnceHiddenArcs(every, f.pairs.tan_1, none, v_1, f.q * f.pairs.cos_dphi, none)
    return direct, twice + 2 * f.sine * once_hidden(half, f.p.size, nodes)


class _Critical(NamedTuple):
    """Critical angles (39), with their sines and v = tan(phi / 2); psi_1 = pi / 2 - phi_1."""

    psi_1: FloatArray
    sin_1: FloatArray
    v_1: FloatArray
    phi_2: FloatArray
    sin_2: FloatArray
    v_2: FloatArray

    @classmethod
    def of(cls, p: FloatArray, q: FloatArray) -> _Critical:
        return cls(np.arcsin(1 / p), *_critical(p), np.arccos(1 / q), *_critical(q))


def _both_hidden(f: _Facets, nodes: int) -> tuple[FloatArray, FloatArray]:
    """Both integrals over the half circle where p, q > 1."""
    c = _Critical.of(f.p, f.q)
    direct, twice = _seen_whole(f, c.psi_1, c.sin_1)
    arcs = []
    for part in (_same_side, _second_alone):
        more_direct, more_twice, its_arcs = part(f, c)
        direct += more_direct
        twice += more_twice
        arcs += its_arcs
    one = OnceHiddenArcs(*(np.concatenate(values) for values in zip(*arcs, strict=True)))
    twice += f.sine * once_hidden(one, f.p.size, nodes)
    more_direct, more_twice = _opposite_sides(f, c, nodes)
    return direct + more_direct, twice + more_twice


class _Overlap(NamedTuple):
    """Arc where both directions are hidden, from 2 atan(low) to 2 atan(high), if low < high.

    `inside`: it ends before the first direction's critical angle. `width` in radians; `turned`:
    integral of y over it.
    """

    low: FloatArray
    high: FloatArray
    inside: BoolArray
    width: FloatArray
    turned: FloatArray

    @classmethod
    def about(
        cls, f: _Facets, c: _Critical, centre: FloatArray, half: tuple[FloatArray, FloatArray]
    ) -> _Overlap:
        """Overlap with the second direction's arc about `centre`, 0 to pi; cos and sin of half."""
        cos_half, sin_half = half
        low = (sin_half - cos_half * c.v_2) / (cos_half + sin_half * c.v_2)
        up, down = sin_half + cos_half * c.v_2, cos_half - sin_half * c.v_2
        inside = up < c.v_1 * down
        high = np.where(inside, up / np.where(inside, down, 1.0), c.v_1)
        cosine, sine = (cos_half - sin_half) * (cos_half + sin_half), 2 * cos_half * sin_half
        end = np.where(inside, c.sin_2, c.sin_1 * cosine - sine / f.p)
        width = np.where(inside, 2 * c.phi_2, np.pi / 2 - c.psi_1 - centre + c.phi_2)
        return cls(low, high, inside, width, f.q * (end + c.sin_2))


def _same_side(f: _Facets, c: _Critical) -> tuple[FloatArray, FloatArray, list[OnceHiddenArcs]]:
    """What changes where both directions are hidden from the same side; arcs of the first alone."""
    pairs = f.pairs
    both = _Overlap.about(f, c, pairs.dphi, (pairs.cos_half, pairs.sin_half))
    larger = np.maximum(pairs.equal - c.psi_1, 0.0)  # arc where y > x
    direct = -4 * pairs.steepness * (f.sine / f.cosine) * np.square(np.sin(larger / 2))
    twice = np.where(both.low < c.v_1, f.one_minus_cos * (both.turned - both.width), 0.0)
    along, across, every = f.q * pairs.cos_dphi, f.q * pairs.sin_dphi, np.arange(f.p.size)
    before = OnceHiddenArcs(every, pairs.tan_1, -c.v_1, np.minimum(both.low, c.v_1), along, across)
    k = np.flatnonzero(both.inside)
    after = OnceHiddenArcs(k, *(x.take(k) for x in (pairs.tan_1, both.high, c.v_1, along, across)))
    return direct, twice, [before, after]


def _second_alone(f: _Facets, c: _Critical) -> tuple[FloatArray, FloatArray, list[OnceHiddenArcs]]:
    """What changes where only the second direction is hidden; its arcs, about azimuth dphi."""
    pairs, sin_d, cos_d = f.pairs, f.pairs.sin_dphi, f.pairs.cos_dphi
    cos_half, sin_half = pairs.cos_half, pairs.sin_half
    low = (c.v_1 * cos_half - sin_half) / (cos_half + c.v_1 * sin_half)
    high = (cos_half - c.v_1 * sin_half) / (c.v_1 * cos_half + sin_half)
    low, high = np.maximum(low, -c.v_2), np.minimum(high, c.v_2)
    # The same arc counted from pi / 2 down: from start to end, u_1 = p sin.
    start = np.maximum(-c.psi_1, np.pi / 2 - pairs.dphi - c.phi_2)
    end = np.minimum(c.psi_1, np.pi / 2 - pairs.dphi + c.phi_2)
    width = np.maximum(end - start, 0.0)
    sin_m, sin_h = np.sin((start + end) / 2), np.sin(width / 2)
    cos_m, sin_w = np.sqrt(1 - sin_m * sin_m), 2 * sin_h * np.sqrt(1 - sin_h * sin_h)
    single = 2 * f.p * sin_m * sin_h  # integral of u_1, and of u_1 u_2
    turned = 2 * sin_w * sin_m * (sin_m * cos_d + cos_m * sin_d)
    product = f.p * f.q / 2 * ((width - sin_w) * cos_d + turned)
    k = np.flatnonzero(low < high)
    arcs = OnceHiddenArcs(
        k, *(x.take(k) for x in (pairs.tan_2, low, high, f.p * cos_d, -f.p * sin_d))
    )
    return 2 * (single - product), f.one_minus_cos * (2 * product - single - width), [arcs]


def _opposite_sides(f: _Facets, c: _Critical, nodes: int) -> tuple[FloatArray, FloatArray]:
    """What changes where both directions are hidden from opposite sides; phi counts backwards."""
    pairs, sin_d, cos_d = f.pairs, f.pairs.sin_dphi, f.pairs.cos_dphi
    both = _Overlap.about(f, c, np.pi - pairs.dphi, (pairs.sin_half, pairs.cos_half))
    k = np.flatnonzero(both.low < c.v_1)
    direct, twice = np.zeros(f.p.size), np.zeros(f.p.size)
    direct[k] = 2 * (both.turned - both.width)[k]
    values = (both.low, both.high, f.p, -f.q * cos_d, f.q * sin_d, f.cosine, f.sine)
    arcs = TwiceHiddenArcs(*(x.take(k) for x in values))
    twice[k] = twice_hidden(arcs, pairs.v_opposite[k], nodes)
    twice[k] -= f.one_minus_cos[k] * (both.turned + both.width)[k]
    return direct, twice
