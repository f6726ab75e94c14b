"""Symmetry test: a surface is rough if its reflection differs on both sides of the normal.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer Vision",
International Journal of Computer Vision 30 (1998), section 3.1: at a fixed incidence a smooth
surface's diffuse radiance is symmetric about theta_r = 0, a rough surface's is not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from analysis.data.covariance import Covariance, angle_sensitivity, append_column, full_covariance
from analysis.data.measurements import Measurements
from analysis.data.sweeps import plane_and_view, sweeps
from analysis.fit.criteria import SIGNIFICANCE, probability
from instrument.geometry import Brdf, FloatArray, IntArray

# Nearer to normal incidence, or to the plane dphi = 90 degrees, any surface is too symmetric.
_MIN_THETA_I_DEG = 5.0
_MIN_OFF_PLANE_DEG = 5.0
_SAME_VIEW_DEG = 0.01
# Effective number of pairs (Kish 1965: (sum w)^2 / sum w^2, weighted by brightness) from which a
# verdict is given: with fewer, one lobe or one bad point decides.
_MIN_EFFECTIVE_PAIRS = 3.0
# Asymmetry that a test must be able to find before a surface is called smooth, at this many
# standard deviations. A roughness of 20 degrees causes more than twice as much.
_NOTABLE_ASYMMETRY, _FOUND_AT = 0.1, 3.0


class Symmetry(NamedTuple):
    """Result of the test.

    outcome: "rough" (asymmetric), "smooth" (symmetric), "undecided" (few pairs carry the
    comparison, or the data are too uncertain to show an asymmetry) or "not tested" (no pairs).
    pairs: number of pairs compared. asymmetry: mean difference of lamp's side and mirror side over
    the mean of their sum. probability: of differences at least as large on a symmetric surface.
    """

    outcome: str
    pairs: int
    asymmetry: float
    probability: float

    def __str__(self) -> str:
        if self.pairs == 0:
            return "symmetry in theta_r: not tested (no view angle on both sides of the normal)"
        side = "lamp's" if self.asymmetry > 0 else "mirror"
        return (
            f"symmetry in theta_r: {self.outcome} ({self.pairs} pairs; {side} side brighter by "
            f"{200 * abs(self.asymmetry):.2g} %, {p_text(self.probability)})"
        )


def p_text(probability: float) -> str:
    """A probability as text; very small ones are only bounded."""
    return f"p = {probability:.2g}" if probability >= 1e-9 else "p < 1e-9"


def symmetry(m: Measurements, smooth: Brdf, noise: float) -> Symmetry:
    """Compare the points at theta_r with those at -theta_r of the same sweep.

    `smooth` is a model near the data (BRDF in 1/sr, of the geometry's shape), which converts errors
    of angles; `noise`, in 1/sr, is the standard deviation of a point where no u is stated.
    """
    pairs = _pairs(m)
    if not pairs:
        return Symmetry("not tested", 0, 0.0, 1.0)
    lamp, mirror = np.array(pairs, dtype=np.int64).T
    difference = m.brdf[lamp] - m.brdf[mirror]
    total = m.brdf[lamp] + m.brdf[mirror]
    C = _covariance(m, smooth, noise, lamp, mirror)
    white = C.whiten(difference)
    chi2 = float(white @ white)
    p = probability(chi2, len(pairs))
    if np.sum(total) <= 0:  # no light in the pairs, so nothing to compare an asymmetry with
        return Symmetry("undecided", len(pairs), 0.0, p)
    u = float(np.linalg.norm(C.common.sum(axis=0))) ** 2 + float(np.sum(C.variance))
    outcome = _outcome(p, total, math.sqrt(u) / float(np.sum(np.abs(total))))
    return Symmetry(outcome, len(pairs), float(np.mean(difference) / np.mean(total)), p)


def _outcome(p: float, total: FloatArray, u_asymmetry: float) -> str:
    """Outcome for pairs of brightness `total` (P,) in 1/sr, and the u of their asymmetry."""
    if float(np.sum(np.abs(total))) ** 2 < _MIN_EFFECTIVE_PAIRS * float(np.sum(total * total)):
        return "undecided"
    if p < SIGNIFICANCE:
        return "rough"
    return "smooth" if _FOUND_AT * u_asymmetry < _NOTABLE_ASYMMETRY else "undecided"


def _pairs(m: Measurements) -> list[tuple[int, int]]:
    """Indices of points on the lamp's side and their mirror images in theta_r, each used once."""
    _, views = plane_and_view(m)
    found = []
    for theta_i, dphi, points in sweeps(m):
        if theta_i < _MIN_THETA_I_DEG or abs(dphi - 90) < _MIN_OFF_PLANE_DEG:
            continue
        towards = 1.0 if dphi < 90 else -1.0  # the sign of theta_r on the lamp's side
        sides = towards * views[points]
        free = np.ones(sides.size, dtype=bool)
        for k in np.flatnonzero(sides > _SAME_VIEW_DEG):
            distance = np.where(free, np.abs(sides + sides[k]), np.inf)
            mirror = int(np.argmin(distance))
            if distance[mirror] < _SAME_VIEW_DEG:
                free[mirror] = False
                found.append((int(points[k]), int(points[mirror])))
    return found


def _covariance(
    m: Measurements, smooth: Brdf, noise: float, lamp: IntArray, mirror: IntArray
) -> Covariance:
    """Covariance of the differences of P pairs; no point belongs to two of them.

    An error of the zero of theta_r, of the same u, is added: it shifts the two sides in opposite
    directions, and many points with independent errors would show that as asymmetry.
    """
    if m.u_random is None:
        return Covariance(np.full(lamp.size, 2 * noise**2), np.zeros((lamp.size, 0)))
    C = full_covariance(m, smooth)
    sign = np.where(plane_and_view(m)[1] == m.theta_r_deg, 1.0, -1.0)
    zero = sign * angle_sensitivity(m, smooth, theta_r=m.u_theta_r_deg)
    return Covariance(
        C.variance[lamp] + C.variance[mirror],
        append_column(C.common[lamp] - C.common[mirror], zero[lamp] - zero[mirror]),
    )
