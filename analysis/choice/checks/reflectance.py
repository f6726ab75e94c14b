"""Directional-hemispherical reflectance: no sample reflects more light than it receives.

The reflectance of an incidence is the integral of BRDF times cos(theta_r) over the hemisphere. From
one plane it has only a lower bound, which needs no model. Its assumption: light reflected out of
the plane is no weaker than the weaker of the two sides in it; a lobe is on one of them. Directions
that were not measured count as dark.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analysis.choice.checks.relative_size import relative_size
from analysis.data.measurements import Measurements
from analysis.data.sweeps import Sweep, plane_and_view, sweeps
from instrument.geometry import FloatArray, IntArray

_FEWEST = 3  # points of a sweep
# Excess over 1 that is told: more than approximate models of a white sample show, and, where no u
# is stated, than a wrong white tile does. Otherwise 3 u.
_NOTABLE, _NOTABLE_WITHOUT_U, _BEYOND = 0.02, 0.05, 3.0
_NEAR_NORMAL_DEG = 15.0  # up to here the innermost value also counts for smaller view angles


class Reflectance(NamedTuple):
    """Lower bound of the reflectance at theta_i (degrees), its u (None: not stated), and points."""

    theta_i_deg: float
    bound: float
    u: float | None
    points: int

    def __str__(self) -> str:
        u = "no u stated" if self.u is None else f"u {self.u:.2g}"
        return (
            f"reflectance above 1: at theta_i {self.theta_i_deg:g} degrees the sample would "
            f"reflect at least {self.bound:.3g} times the light that it receives ({u}; from "
            f"{self.points} points of one sweep); {self._cause}"
        )

    @property
    def _cause(self) -> str:
        if self.bound <= math.pi * (1 + _NOTABLE_WITHOUT_U):
            return (
                "the values may be radiance factors, which are pi times the BRDF: if they are, "
                "divide them by pi; if not, check the reflectance of the white tile"
            )
        return (
            "check the unit of the values: the BRDF is in 1/sr, not in % and not in counts; values "
            "without a reference are fitted with --relative (from Python: relative=True)"
        )


def reflectance_above_one(m: Measurements) -> Reflectance | None:
    """Return the largest bound above 1 of all sweeps, None if there is none."""
    if m.relative:
        return None
    _, views = plane_and_view(m)
    found = [_bound(m, views, sweep) for sweep in sweeps(m) if sweep.points.size >= _FEWEST]
    above = [one for one in found if one.bound > 1 + _excess(one)]
    return max(above, key=lambda one: one.bound, default=None)


def _excess(one: Reflectance) -> float:
    return _NOTABLE_WITHOUT_U if one.u is None else max(_NOTABLE, _BEYOND * one.u)


def _bound(m: Measurements, views: FloatArray, sweep: Sweep) -> Reflectance:
    points = sweep.points
    theta, f = views[points], m.brdf[points]
    # pi times the integral over sin(theta_r)^2 is the integral over the hemisphere.
    nodes, low = _weaker_side(theta, f)
    s = np.sin(np.radians(nodes)) ** 2
    total = float(np.sum((low[1:] + low[:-1]) / 2 * np.diff(s)))
    if nodes[0] <= _NEAR_NORMAL_DEG:
        total += float(low[0] * s[0])
    bound = math.pi * total
    u = None if m.u_random is None else bound * _relative_u(m, points)
    return Reflectance(sweep.theta_i_deg, bound, u, int(points.size))


def _weaker_side(theta: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """View angles (K,) in degrees, and the weaker side there in 1/sr, lowest of three neighbours.

    Where one side alone was measured, its lowest value.
    """
    sides = [theta <= 0, theta >= 0]
    if min(np.count_nonzero(side) for side in sides) < _FEWEST:
        nodes = np.array([np.min(np.abs(theta)), np.max(np.abs(theta))])
        return nodes, np.full(2, np.min(f))
    known = [(np.abs(theta[side]), f[side]) for side in sides]
    known = [(t[order], v[order]) for t, v in known for order in (np.argsort(t),)]
    first, last = max(t[0] for t, _ in known), min(t[-1] for t, _ in known)
    nodes = np.unique(np.abs(theta))
    nodes = nodes[(nodes >= first) & (nodes <= last)]
    if nodes.size == 0:  # the sides do not overlap
        return np.zeros(2), np.zeros(2)
    weaker = np.min([np.interp(nodes, t, v) for t, v in known], axis=0)
    wide = np.pad(weaker, 1, mode="edge")
    return nodes, np.min([wide[:-2], wide[1:-1], wide[2:]], axis=0)


def _relative_u(m: Measurements, points: IntArray) -> float:
    """Relative u of a mean of the points, about: their noise, and what they share."""
    noise = relative_size(np.asarray(m.u_random)[points], m.brdf[points])
    shared = [float(np.mean(error.u_relative[points])) for error in m.shared]
    return math.hypot(float(np.median(noise)) / math.sqrt(points.size), *shared)
