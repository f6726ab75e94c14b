"""Oren and Nayar's model without its approximations: the Gaussian surface (31) by integration.

What to use when: `oren_nayar_exact` where the error of the functional form (`oren_nayar`) matters:
at oblique angles, far forward, at high roughness.

Method: the isotropic single-slope radiance (29) of a geometry does not depend on sigma, and on the
albedo only by its powers. A `Profile` stores it at the nodes of a quadrature over the slope
theta_a, so that a new sigma or albedo is only a new weighting; the latest profiles are cached.

The slopes are divided at every kink: 90 - theta_i and 90 - theta_r, where shadowing and masking set
in, and the two slopes at which a critical azimuth of the lamp meets one of the camera. Within a
piece the nodes are spaced in e-folds of the slope (narrow and wide Gaussians then need the same
number) and clustered at its start, where shadowing and masking set in with half-integer powers:
Gauss-Legendre converges exponentially. Below the first kink the radiance is 1 + tan^2(theta_a)
times a constant, and its mean comes from a table for each sigma.

Source: M. Oren, S. K. Nayar, "Generalization of the Lambertian Model and Implications for Machine
Vision", International Journal of Computer Vision 14 (1995), section 4.3.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np

from analysis.models.base import Model, Validity
from analysis.models.lambert import ALBEDO
from analysis.models.rough.oren_nayar_forms import SIGMA_DEG
from analysis.models.rough.single_slope import DirectionPairs, mean_over_azimuths
from analysis.models.specular.torrance_sparrow import gaussian_normalisation, mean_square_slope
from analysis.models.validity import both_graze, valid_except
from instrument.geometry import FloatArray, Geometry, IntArray


class Rule(NamedTuple):
    """Numbers of nodes: `slopes` per piece, `per_e` more per e-fold of slope, `azimuths` per arc.

    A shorter piece uses fewer of the `slopes`; for the arcs see `single_slope`.
    """

    slopes: int
    per_e: int
    azimuths: int


RULE = Rule(5, 6, 10)
"""1e-6 relative."""
COARSE = Rule(3, 5, 6)
"""1e-4 relative."""
FINE = Rule(8, 10, 36)
"""1e-8 relative."""

CACHE_BYTES = 256 * 2**20
"""Size limit of the profile cache, about 1 kB a geometry; the least recently used goes first."""

_BLOCK = 1024  # geometries at a time: their arrays stay in the processor's cache
_MIRROR = 1e-8  # radians: a surface of slopes below it is Lambert's to rounding
_CLOSED_END = math.radians(80)  # end of the closed part: beyond, tan^2 grows too steeply
_OFFSET = math.radians(0.3)  # slopes well below it are counted in degrees, not in e-folds


def oren_nayar_exact_brdf(
    geometry: Geometry, albedo: float, sigma_deg: float, rule: Rule = RULE
) -> FloatArray:
    """Oren and Nayar's exact BRDF: 1995, equations (31) with (29), (28), (27), (16), (24).

    Arguments and result as in `Model.brdf`. V-cavities of Lambertian facets whose slope angle is
    normally distributed with the standard deviation `sigma_deg` (32): exact shadowing and masking,
    exact light of two bounces, no mixing of azimuths (44). Erratum: (31) lacks 2 pi. Reciprocal to
    the last bit; never negative; Lambert's at sigma = 0. It grows without limit only where lamp and
    camera both graze the surface and are not opposite to each other.

    Accuracy, relative, for sigma 0.5 to 60 degrees, theta up to 85 degrees, all dphi: 1e-6. The
    first evaluation of a geometry takes 22 us (one core of 2 GHz), a new sigma or albedo on it
    0.6 us. With `COARSE` 1e-4: 14 us and 0.45 us; with `FINE` 1e-8: 75 us and 1 us. The functional
    form takes 0.08 us. Nearer to grazing 1e-6 becomes 4e-6 (89.9 degrees) and, between there and
    90, 6e-5; at 90 the value is the limit.

    In the plane of incidence the surface itself has a cusp where the camera meets the lamp.
    """
    direct, twice = _averages(geometry, math.radians(sigma_deg), 0, rule)
    return (albedo / np.pi) * (direct + albedo * twice)


def oren_nayar_exact_gradient(
    geometry: Geometry, albedo: float, sigma_deg: float
) -> dict[str, FloatArray]:
    """Derivatives of `oren_nayar_exact_brdf` by albedo and sigma. As in `Model.gradient`.

    Under the integral: d ln P / d sigma = (theta_a^2 - <theta_a^2>) / sigma^3, where the mean
    square slope <theta_a^2> is the normalisation's part.
    """
    sigma = math.radians(sigma_deg)
    direct, twice = _averages(geometry, sigma, 0, RULE)
    by_albedo = (direct + 2 * albedo * twice) / np.pi
    if sigma < _MIRROR:
        return {"albedo": by_albedo, "sigma_deg": np.zeros(geometry.shape)}
    direct2, twice2 = _averages(geometry, sigma, 1, RULE)
    mean2 = mean_square_slope(sigma)
    spread = (direct2 - mean2 * direct) + albedo * (twice2 - mean2 * twice)
    by_sigma = (albedo / np.pi) * spread / sigma**3
    return {"albedo": by_albedo, "sigma_deg": math.radians(1) * by_sigma}


class Nodes(NamedTuple):
    """Pieces with the same number of nodes; `at` (piece,): index of the geometry of each.

    Of shape (node, piece): squares of theta_a, and the two parts of the radiance times sin(theta_a)
    and the weight.
    """

    theta2: FloatArray
    direct: FloatArray
    twice: FloatArray
    at: IntArray


@dataclass(frozen=True, slots=True)
class Profile:
    """Single-slope radiance of some geometries over the slope: all of (31) but P.

    Up to the slope `first` the parts are cos(theta_a) (1 + bend tan^2 / 2) and
    cos(theta_a) (1 - cos(theta_a)) (1 - bend tan^2 / 2), bend = tan_i tan_r cos(dphi); beyond it,
    `nodes`.
    """

    first: FloatArray
    bend: FloatArray
    nodes: tuple[Nodes, ...]

    @property
    def nbytes(self) -> int:
        """Size of the arrays in bytes."""
        own = self.first.nbytes + self.bend.nbytes
        return own + sum(array.nbytes for nodes in self.nodes for array in nodes)

    def average(self, sigma: float, power: int) -> tuple[FloatArray, FloatArray]:
        """Mean of theta_a^(2 power) times each part over the slopes: (31) with its 2 pi.

        `sigma` in radians. Direct and two-bounce part, (N,), in units of `v_cavity`.
        """
        flat, flat2, bent, bent2 = _table(sigma, power).at(self.first)
        direct, twice = flat + self.bend * flat2, bent - self.bend * bent2
        for nodes in self.nodes:
            density = nodes.theta2 * (-0.5 / sigma**2)
            np.exp(density, out=density)
            if power:
                density *= nodes.theta2**power
            twice += np.bincount(nodes.at, (density * nodes.twice).sum(axis=0), twice.size)
            density *= nodes.direct
            direct += np.bincount(nodes.at, density.sum(axis=0), direct.size)
        scale = 2 * math.pi * gaussian_normalisation(sigma)
        return scale * direct, scale * twice


def profile(larger: FloatArray, smaller: FloatArray, dphi: FloatArray, rule: Rule) -> Profile:
    """Profile of geometries (N,): larger and smaller of theta_i and theta_r, and dphi, in radians.

    The radiance over E0 cos(theta_i) is reciprocal, so the order does not matter.
    """
    edges = slope_kinks(larger, smaller, dphi)
    drawn = list(_drawn(edges, rule))
    at = np.concatenate([np.tile(own, theta.shape[0]) for theta, _, own in drawn])
    slopes = np.concatenate([theta.ravel() for theta, _, _ in drawn])
    pairs = DirectionPairs.of(larger, smaller, dphi)
    parts = mean_over_azimuths(pairs, at, slopes, rule.azimuths)
    ends = np.cumsum([theta.size for theta, _, _ in drawn])[:-1]
    split = (np.split(part, ends) for part in parts)
    nodes = [
        Nodes(theta * theta, weight * direct.reshape(shape), weight * twice.reshape(shape), own)
        for (theta, weight, own), direct, twice in zip(drawn, *split, strict=True)
        for shape in [theta.shape]
    ]
    return Profile(edges[0], pairs.tan_1 * pairs.tan_2 * pairs.cos_dphi, tuple(nodes))


def _drawn(edges: FloatArray, rule: Rule) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
    """Nodes theta_a and weights times sin(theta_a), both (node, piece), with each piece's geometry.

    Pieces with the same number of nodes come together. `edges` as of `slope_kinks`.
    """
    start, end = edges[:-1], edges[1:]
    width = np.log((end + _OFFSET) / (start + _OFFSET))
    e_folds = width.copy()  # tan^2 of the first piece has its pole at 90 degrees, just beyond it
    beyond = np.pi / 2 + _OFFSET
    e_folds[0] += np.log((beyond - start[0]) / (beyond - end[0]))
    # The error of a piece is proportional to its width: one narrower by 1e-8 needs no nodes.
    share = np.clip(1 + np.log(np.maximum(width, 1e-9)) / math.log(1e8), 0.1, 1.0)
    count = np.ceil(rule.slopes * share + rule.per_e * e_folds).astype(np.intp)
    count[end - start < 1e-12] = 0
    for number in np.unique(count[count > 0]):
        piece, geometry = np.nonzero(count == number)
        theta, weight = _clustered(start[piece, geometry], width[piece, geometry], int(number))
        yield theta, weight * np.sin(theta), geometry


def slope_kinks(larger: FloatArray, smaller: FloatArray, dphi: FloatArray) -> FloatArray:
    """Slopes theta_a in radians, rising, between which (29) is smooth: shape (6, ...).

    The end of the closed part, 90 - theta of the two directions, the slopes at which facets of one
    azimuth are critical (39) for lamp and camera at once, and 90 degrees.
    """
    a, b = np.tan(larger), np.tan(smaller)
    across = a * b * np.sin(dphi)
    one_side = np.arctan2(np.hypot(a - b, 2 * np.sqrt(a * b) * np.sin(dphi / 2)), across)
    two_sides = np.arctan2(np.hypot(a - b, 2 * np.sqrt(a * b) * np.cos(dphi / 2)), across)
    right = np.full_like(a, np.pi / 2)
    set_in, both = right - larger, right - smaller
    closed = np.minimum(set_in, _CLOSED_END)
    meet = np.clip(np.sort([one_side, two_sides], axis=0), both, right)
    return np.stack([closed, set_in, both, *meet, right])


def _clustered(start: FloatArray, width: FloatArray, number: int) -> tuple[FloatArray, FloatArray]:
    """Nodes theta_a and weights on pieces that span `width` e-folds: shape (number, piece).

    t^2 (5 - t) / 4 clusters the nodes at the start: a half-integer power there becomes an integer
    one.
    """
    t, w = (array[:, None] for array in _gauss(number))
    shifted = (start + _OFFSET) * np.exp(width * (t * t * (5 - t) / 4))
    weight = shifted * width * (t * (10 - 3 * t) / 4 * w)
    return np.clip(shifted - _OFFSET, 0.0, np.pi / 2), weight


class _Table(NamedTuple):
    """Integrals from 0 to theta_a in steps, rows one for each integrand, and step x integrand."""

    step: float
    values: FloatArray
    gradients: FloatArray

    def at(self, theta: FloatArray) -> FloatArray:
        """Integrals up to theta by cubic Hermite interpolation, about 1e-9; the last one beyond."""
        last = self.values.shape[1] - 1
        s = np.minimum(theta / self.step, float(last))
        i = np.minimum(s.astype(np.intp), last - 1)
        s -= i
        r = 1 - s
        ends = s * s * (3 - 2 * s)
        value = self.values[:, i] * (1 - ends) + self.values[:, i + 1] * ends
        return np.asarray(value + s * r * (r * self.gradients[:, i] - s * self.gradients[:, i + 1]))


@lru_cache(maxsize=256)
def _table(sigma: float, power: int) -> _Table:
    """Integrals of the closed part's four terms times theta^(2 power) and the bare Gaussian."""
    steps = 256
    step = min(_CLOSED_END, 10 * sigma) / steps

    def terms(theta: FloatArray) -> FloatArray:
        sine, cosine = np.sin(theta), np.cos(theta)
        flat = np.exp(-0.5 * np.square(theta / sigma)) * sine * cosine * theta ** (2 * power)
        half_tan2, hidden = 0.5 * np.square(sine / cosine), 2 * np.square(np.sin(theta / 2))
        return np.stack([flat, flat * half_tan2, flat * hidden, flat * half_tan2 * hidden])

    t, w = _gauss(4)
    each = terms(step * (np.arange(steps)[:, None] + t)) @ (w * step)
    values = np.concatenate([np.zeros((4, 1)), np.cumsum(each, axis=1)], axis=1)
    return _Table(step, values, step * terms(step * np.arange(steps + 1.0)))


@cache
def _gauss(number: int) -> tuple[FloatArray, FloatArray]:
    """Nodes and weights of Gauss-Legendre quadrature from 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(number)
    return (x + 1) / 2, w / 2


def _averages(
    geometry: Geometry, sigma: float, power: int, rule: Rule
) -> tuple[FloatArray, FloatArray]:
    """`Profile.average` of any number of geometries, of the geometry's shape."""
    direct, twice = np.ones(geometry.shape), np.zeros(geometry.shape)
    if sigma >= _MIRROR:
        flat_direct, flat_twice = direct.reshape(-1), twice.reshape(-1)
        for block, part in _profiles(geometry, rule):
            flat_direct[block], flat_twice[block] = part.average(sigma, power)
    return direct, twice


def _profiles(geometry: Geometry, rule: Rule) -> Iterator[tuple[slice, Profile]]:
    theta_i, theta_r = geometry.theta_i.ravel(), geometry.theta_r.ravel()
    dphi_deg = geometry.dphi_deg.ravel()
    dphi = np.radians(np.minimum(dphi_deg, 360 - dphi_deg))
    larger, smaller = np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r)
    for start in range(0, larger.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        yield block, _CACHE.get(larger[block], smaller[block], dphi[block], rule)


class _ProfileCache:
    """Profiles by the bytes of their geometry, within CACHE_BYTES; safe between threads."""

    def __init__(self) -> None:
        self._profiles: OrderedDict[tuple[bytes, Rule], Profile] = OrderedDict()
        self._nbytes = 0
        self._lock = Lock()

    def get(self, larger: FloatArray, smaller: FloatArray, dphi: FloatArray, rule: Rule) -> Profile:
        key = (larger.tobytes() + smaller.tobytes() + dphi.tobytes(), rule)
        with self._lock:
            if key in self._profiles:
                self._profiles.move_to_end(key)
                return self._profiles[key]
        made = profile(larger, smaller, dphi, rule)
        with self._lock:
            if key not in self._profiles:
                self._profiles[key] = made
                self._nbytes += made.nbytes
            while self._nbytes > CACHE_BYTES:
                self._nbytes -= self._profiles.popitem(last=False)[1].nbytes
        return made

    def clear(self) -> None:
        """Drop all profiles."""
        with self._lock:
            self._profiles.clear()
            self._nbytes = 0


_CACHE = _ProfileCache()
clear_profile_cache = _CACHE.clear
"""Drop the cached profiles and free their memory."""


def oren_nayar_exact_validity(geometry: Geometry, albedo: float, sigma_deg: float) -> Validity:
    """Valid unless lamp and camera both graze: no limit there. Arguments as in `Model.brdf`."""
    grazing = both_graze(geometry) & (albedo > 0) & (sigma_deg > 0)
    return valid_except(geometry, (grazing, "lamp and camera both graze the surface: no limit"))


OREN_NAYAR_EXACT = Model(
    "oren_nayar_exact",
    (ALBEDO, SIGMA_DEG),
    oren_nayar_exact_brdf,
    oren_nayar_exact_gradient,
    oren_nayar_exact_validity,
    in_blocks=False,
)
