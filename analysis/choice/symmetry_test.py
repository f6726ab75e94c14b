"""Rough or smooth? Whether a surface looks alike from both sides of its normal.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer Vision",
International Journal of Computer Vision 30 (1998), section 3.1: at a fixed incidence a smooth
surface's diffuse radiance is symmetric about theta_r = 0, a rough surface's is not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc

from analysis.data.covariance import Covariance, change, shared, with_column
from analysis.data.measurements import Measurements
from analysis.data.sweeps import in_plane, sweeps
from instrument.geometry import Brdf, IntArray

# A difference less probable than this is one of the surface.
UNLIKELY = 1e-3
# Nearer to the normal the lamp itself is too symmetric, and so is the dphi = 90 degrees plane.
_LEAST_THETA_I_DEG = 5.0
_LEAST_OFF_DEG = 5.0
# The same view angle on both sides, in degrees.
_SAME = 0.01


class Symmetry(NamedTuple):
    """The test's outcome.

    says: "rough" (asymmetric), "smooth" (symmetric) or "not tested" (no pairs of view angles).
    pairs: how many were compared. asymmetry: (lamp's side - mirror side) over their sum, the mean
    over the pairs. probability: of differences as large as these if the surface were symmetric.
    """

    says: str
    pairs: int
    asymmetry: float
    probability: float

    def __str__(self) -> str:
        if self.pairs == 0:
            return "symmetry in theta_r: not tested (no view angle on both sides of the normal)"
        side = "lamp's" if self.asymmetry > 0 else "mirror"
        return (
            f"symmetry in theta_r: {self.says} ({self.pairs} pairs; {side} side brighter by "
            f"{200 * abs(self.asymmetry):.2g} %, {p_text(self.probability)})"
        )


def p_text(probability: float) -> str:
    """A probability as people read it; how small a very small one is says nothing."""
    return f"p = {probability:.2g}" if probability >= 1e-9 else "p < 1e-9"


def symmetry(m: Measurements, smooth: Brdf, noise: float) -> Symmetry:
    """Compare the points at theta_r with those at -theta_r of the same sweep.

    `smooth` is a model near the data, which turns errors of angles into such of the BRDF; `noise`,
    in 1/sr, is the standard deviation of a point where the measurements state no u.
    """
    pairs = _pairs(m)
    if not pairs:
        return Symmetry("not tested", 0, 0.0, 1.0)
    lamp, mirror = np.array(pairs, dtype=np.int64).T
    difference = m.brdf[lamp] - m.brdf[mirror]
    total = m.brdf[lamp] + m.brdf[mirror]
    white = _covariance(m, smooth, noise, lamp, mirror).whiten(difference)
    chi2 = float(white @ white)
    probability = float(chdtrc(float(len(pairs)), chi2))
    says = "rough" if probability < UNLIKELY else "smooth"
    return Symmetry(says, len(pairs), float(np.mean(difference) / np.mean(total)), probability)


def _pairs(m: Measurements) -> list[tuple[int, int]]:
    """Places of the points on the lamp's side, and of their twins on the mirror side, each once."""
    _, views = in_plane(m)
    found = []
    for theta_i, dphi, points in sweeps(m):
        if theta_i < _LEAST_THETA_I_DEG or abs(dphi - 90) < _LEAST_OFF_DEG:
            continue
        towards = 1.0 if dphi < 90 else -1.0  # the sign of theta_r on the lamp's side
        sides = towards * views[points]
        free = np.ones(sides.size, dtype=bool)
        for k in np.flatnonzero(sides > _SAME):
            apart = np.where(free, np.abs(sides + sides[k]), np.inf)
            twin = int(np.argmin(apart))
            if apart[twin] < _SAME:
                free[twin] = False
                found.append((int(points[k]), int(points[twin])))
    return found


def _covariance(
    m: Measurements, smooth: Brdf, noise: float, lamp: IntArray, mirror: IntArray
) -> Covariance:
    """Covariance of the differences of P pairs; no point is in two of them.

    All theta_r may be off alike by u, too: a zero that is off shifts the two sides apart, which
    many points would show as asymmetry if the error of each were independent.
    """
    if m.u_random is None:
        return Covariance(np.full(lamp.size, 2 * noise**2), np.zeros((lamp.size, 0)))
    C = shared(m, smooth)
    turned = np.where(in_plane(m)[1] == m.theta_r_deg, 1.0, -1.0)
    zero = turned * change(m, smooth, theta_r=m.u_theta_r_deg)
    return Covariance(
        C.variance[lamp] + C.variance[mirror],
        with_column(C.common[lamp] - C.common[mirror], zero[lamp] - zero[mirror]),
    )
