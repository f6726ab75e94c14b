"""Helmholtz reciprocity: the BRDF stays the same when lamp and camera change places.

Every reciprocal pair of an isotropic sample must agree, whatever its reflectance. A break has a
cause that no reflectance model can describe: an anisotropic or uneven sample, or values that are a
BRDF times one cosine. The second is recognised by its size in each pair; and where one factor of
each incidence explains all pairs, white tile and lamp are suspect before the sample.

Source: W. C. Snyder, "Reciprocity of the Bidirectional Reflectance Distribution Function (BRDF) in
Measurements and Models of Structured Surfaces", IEEE Transactions on Geoscience and Remote Sensing
36 (1998).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.choice.checks.relative_size import relative_size
from analysis.data.covariance import Covariance, full_covariance
from analysis.data.measurements import Measurements
from analysis.data.sweeps import plane_and_view, sweeps
from analysis.fit.criteria import SIGNIFICANCE, probability
from instrument.geometry import Brdf, FloatArray, IntArray

# Largest distance of two directions that count as one, and least difference of the two angles of a
# pair, in degrees: nearer to theta_i = theta_r a pair is one geometry measured twice.
_SAME_DEG, _LEAST_APART_DEG = 0.25, 2.0
# Least median difference that is told, relative to the value. With a stated u: above what a tilt of
# 0.2 degrees does to a matt sample. Without: above the noise of a usual table.
_NOTABLE, _NOTABLE_WITHOUT_U = 0.02, 0.05
# Pairs. One alone tells a cosine, if it agrees with it closely, and nothing else.
_FEWEST, _FEWEST_WITHOUT_U = 2, 5
# Standard deviations by which more than half of the pairs must differ, so that a few outliers are
# no verdict on the sample.
_BEYOND = 3.0
# A cosine, or one factor of each incidence, is the cause where dividing by it leaves no more than
# this share of the difference. Factors need twice as many pairs, or they would explain anything.
_LEFT_BY_CAUSE, _LEFT_BY_CAUSE_OF_ONE = 1 / 3, 1 / 10
_PAIRS_PER_LEVEL = 2
_MOST_LEVELS = 8  # that are listed
# Steps of a sweep, in degrees, whose second differences show noise rather than shape.
_FINE_STEP_DEG = 10.0
_SIGMA_PER_MEDIAN = 1.4826  # of the absolute values of normal errors

INCIDENCE = "incidence"
"""Cause of a break: one factor of each incidence."""


class Reciprocity(NamedTuple):
    """Break of reciprocity in a number of pairs.

    median, largest: difference in a pair over its mean value. at_deg: theta_i, theta_r and dphi of
    the largest, in degrees. u: median standard uncertainty of such a difference, None where no u is
    stated. cause: "cos(theta_i)" or "cos(theta_r)" where the values are a BRDF times that cosine,
    INCIDENCE where one factor of each incidence explains them, else "". left: median difference
    that remains when the cause is divided out. levels: theta_i in degrees and the factor of each
    incidence, relative to the first, for that cause.
    """

    pairs: int
    median: float
    largest: float
    at_deg: tuple[float, float, float]
    u: float | None
    cause: str
    left: float
    levels: tuple[tuple[float, float], ...] = ()

    @property
    def by_cosine(self) -> bool:
        """True if the values are a BRDF times one cosine."""
        return self.cause not in ("", INCIDENCE)

    def __str__(self) -> str:
        u = "no u stated" if self.u is None else f"u {100 * self.u:.2g} %"
        theta_i, theta_r, dphi = self.at_deg
        pairs = "pair" if self.pairs == 1 else "pairs"
        seen = (
            "reciprocity (Helmholtz) is broken: with lamp and camera exchanged, values differ by "
            f"{100 * self.median:.2g} % (median of {self.pairs} {pairs}, {u}; largest "
            f"{100 * self.largest:.2g} %, at theta_i {theta_i:.4g}, theta_r {theta_r:.4g}, dphi "
            f"{dphi:.4g} degrees)"
        )
        if self.by_cosine:
            return (
                f"{seen}, but by {100 * self.left:.2g} % once divided by {self.cause}: the values "
                f"seem to be the BRDF times {self.cause}; if they are, divide by it"
            )
        return f"{seen}. No model of a flat isotropic sample can fit: {self._remedy}"

    @property
    def _remedy(self) -> str:
        sample = (
            "the sample is probably anisotropic (grain, weave, brushing) or not flat; turn it by "
            "90 degrees in its plane, measure again and compare"
        )
        if self.cause != INCIDENCE:
            return sample
        shown = self.levels[:_MOST_LEVELS]
        factors = ", ".join(f"{factor:.4g} at {theta_i:g}" for theta_i, factor in shown)
        return (
            f"one factor of each incidence would explain it ({factors} degrees; left: "
            f"{100 * self.left:.2g} %), such as of a white tile that is not matt, a lamp that "
            f"changed, or a tilt of the sample. If these are in order, {sample}"
        )


def reciprocity(m: Measurements, smooth: Brdf) -> Reciprocity | None:
    """Return the break of reciprocity; None where there is none, or too few pairs to show it.

    `smooth` is a model near the data (BRDF in 1/sr, of the geometry's shape): it converts errors of
    angles, and the small distance between the directions of a pair.
    """
    low, high = reciprocal_pairs(m)
    if low.size < (_FEWEST_WITHOUT_U if m.u_random is None else 1):
        return None
    mean, model = (m.brdf[low] + m.brdf[high]) / 2, smooth(m.geometry)
    difference = m.brdf[low] - m.brdf[high] - (model[low] - model[high])
    relative = relative_size(difference, np.maximum(mean, 0.0))
    median = float(np.median(relative))
    C = None if m.u_random is None else _covariance(m, smooth, low, high)
    if not (_scattered_more(m, median) if C is None else _beyond_u(C, difference, median)):
        return None
    worst = int(np.argmax(np.where(mean > 0, relative, 0.0)))
    k = low[worst]
    at = float(m.theta_i_deg[k]), float(m.theta_r_deg[k]), float(m.dphi_deg[k])
    u = None if C is None else float(np.median(C.u_total / np.abs(mean)))
    cause = _cause(m, low, high)
    found = Reciprocity(low.size, median, float(relative[worst]), at, u, *cause)
    return found if found.by_cosine or low.size >= _FEWEST else None


def reciprocal_pairs(m: Measurements) -> tuple[IntArray, IntArray]:
    """Indices (P,) of the points of each pair, first the one with the smaller theta_i.

    dphi counts without its sign, as it does for an isotropic sample. Each point is used once.
    """
    g = m.geometry
    azimuth = np.minimum(g.dphi_deg, 360.0 - g.dphi_deg)
    order = np.argsort(g.theta_i_deg, kind="stable")
    incidences = g.theta_i_deg[order]
    lower = np.flatnonzero(g.theta_r_deg - g.theta_i_deg > _LEAST_APART_DEG)
    begin = np.searchsorted(incidences, g.theta_r_deg[lower] - _SAME_DEG)
    end = np.searchsorted(incidences, g.theta_r_deg[lower] + _SAME_DEG, side="right")
    free, found = np.ones(m.size, dtype=bool), []
    for k, first, last in zip(
        lower[begin < end], begin[begin < end], end[begin < end], strict=True
    ):
        near = order[first:last]
        turned = np.abs(azimuth[near] - azimuth[k]) * np.sin(np.radians(g.theta_i_deg[k]))
        distance = np.maximum(np.abs(g.theta_r_deg[near] - g.theta_i_deg[k]), turned)
        distance = np.where(free[near], distance, np.inf)
        best = int(np.argmin(distance))
        if distance[best] <= _SAME_DEG:
            free[near[best]] = False
            found.append((k, near[best]))
    pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def _covariance(m: Measurements, smooth: Brdf, low: IntArray, high: IntArray) -> Covariance:
    """Covariance of the differences; no point belongs to two pairs."""
    C = full_covariance(m, smooth)
    return Covariance(C.variance[low] + C.variance[high], C.common[low] - C.common[high])


def _beyond_u(C: Covariance, difference: FloatArray, median: float) -> bool:
    white = C.whiten(difference)
    return (
        median >= _NOTABLE
        and float(np.mean(np.abs(white) > _BEYOND)) > 0.5
        and probability(float(white @ white), white.size) < SIGNIFICANCE
    )


def _scattered_more(m: Measurements, median: float) -> bool:
    """True if pairs differ by more than a usual noise, and than the scatter along the sweeps."""
    return median >= max(_NOTABLE_WITHOUT_U, _BEYOND * _scatter(m))


def _scatter(m: Measurements) -> float:
    """Relative noise of a point by the second differences along fine sweeps, 0 without such."""
    _, views = plane_and_view(m)
    found = [np.zeros(0)]
    for _, _, points in sweeps(m):
        f, step = m.brdf[points], np.diff(views[points])
        fine = np.maximum(step[1:], step[:-1]) <= _FINE_STEP_DEG
        middle = (step[1:] * f[:-2] + step[:-1] * f[2:]) / np.maximum(step[1:] + step[:-1], 1e-9)
        found.append(relative_size(f[1:-1] - middle, f[1:-1])[fine])
    bends = np.concatenate(found)
    # The mean of two neighbours and the value between them: variance 3/2 of a point's.
    return _SIGMA_PER_MEDIAN * float(np.median(bends)) / np.sqrt(1.5) if bends.size else 0.0


def _cause(
    m: Measurements, low: IntArray, high: IntArray
) -> tuple[str, float, tuple[tuple[float, float], ...]]:
    """Cause that explains the differences, the median one that it leaves, and its levels."""
    lit = (m.brdf[low] > 0) & (m.brdf[high] > 0)
    if 2 * np.count_nonzero(lit) < lit.size:
        return "", 0.0, ()
    low, high = low[lit], high[lit]
    ratio = np.log(m.brdf[low] / m.brdf[high])
    cos = np.maximum(np.cos(m.geometry.theta_i), np.finfo(float).tiny)
    expected = np.log(cos[low] / cos[high])
    rests = {"cos(theta_i)": ratio - expected, "cos(theta_r)": ratio + expected}
    levels, rests[INCIDENCE] = _levels(m, low, high, ratio)
    share = _LEFT_BY_CAUSE if ratio.size >= _FEWEST else _LEFT_BY_CAUSE_OF_ONE
    most = share * float(np.median(np.abs(ratio)))
    for name, rest in rests.items():
        left = float(np.median(np.abs(rest)))
        if left <= most:
            return name, left, levels if name == INCIDENCE else ()
    return "", 0.0, ()


def _levels(
    m: Measurements, low: IntArray, high: IntArray, ratio: FloatArray
) -> tuple[tuple[tuple[float, float], ...], FloatArray]:
    """Factor of each incidence, and the logarithmic ratios (P,) that they leave.

    No factors, and the whole ratios, where the pairs are too few for them.
    """
    ends = np.round(np.concatenate([m.theta_i_deg[low], m.theta_i_deg[high]]))
    incidences, member = np.unique(ends, return_inverse=True)
    if low.size < _PAIRS_PER_LEVEL * (incidences.size - 1):
        return (), ratio
    pairs, design = np.arange(low.size), np.zeros((low.size, incidences.size))
    design[pairs, member[: low.size]] = 1.0
    design[pairs, member[low.size :]] -= 1.0
    best, *_ = np.linalg.lstsq(design, ratio, rcond=None)
    factors = np.exp(best - best[0])
    levels = tuple(zip(incidences.tolist(), factors.tolist(), strict=True))
    return levels, np.asarray(ratio - design @ best)
