"""Repeated measurements of one geometry: their mean, weighted by their uncertainties."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.data.measurements import Measurements, SharedError
from instrument.geometry import FloatArray, IntArray

_NOTABLE = 1.5  # scatter of repeats in their u


@dataclass(frozen=True, slots=True)
class Repeats:
    """Number of geometries measured more than once, of rows averaged, and their scatter.

    scatter: pooled standard deviation of repeats about their mean, in their u (1 if u is right);
    relative to the mean value where no u is stated.
    """

    geometries: int
    rows: int
    scatter: float

    @property
    def exceed_u(self) -> bool:
        """True where the scatter is far above 1 for its degrees of freedom."""
        freedom = self.rows - self.geometries
        return freedom > 0 and self.scatter > max(_NOTABLE, 1 + 3 / np.sqrt(2 * freedom))


def mean_of_repeats(m: Measurements) -> tuple[Measurements, Repeats]:
    """Return one point for each geometry at one setting of the lamp, in the order of the first.

    The mean is weighted by 1/u_random² where u is stated, and has the u of such a mean (GUM H.3:
    1/u² add); errors that the repeats share do not become smaller. Repeats that do not share the
    same errors (another lamp setting, another group) remain points of their own.
    """
    member, first = _members(m)
    weight = np.ones(m.size) if m.u_random is None else m.u_random**-2.0
    total = np.bincount(member, weight)

    def mean(values: FloatArray | float) -> FloatArray:
        return np.asarray(np.bincount(member, weight * values) / total)

    brdf = mean(m.brdf)
    found = replace(
        m,
        theta_i_deg=m.theta_i_deg[first],
        theta_r_deg=m.theta_r_deg[first],
        dphi_deg=m.dphi_deg[first],
        brdf=brdf,
        u_random=None if m.u_random is None else np.asarray(total**-0.5),
        lamp_setting=m.lamp_setting[first],
        blur_deg=mean(m.blur_deg),
        shared=tuple(
            SharedError(e.name, mean(e.u_relative), e.group[first], *map(mean, e.angles_deg))
            for e in m.shared
        ),
    )
    return found, _summary(m, member, brdf)


def _members(m: Measurements) -> tuple[IntArray, IntArray]:
    """Number of each point's geometry (N,), counted in the order of their first points (M,)."""
    keys = (m.theta_i_deg, m.theta_r_deg, m.dphi_deg, m.lamp_setting, *(e.group for e in m.shared))
    # Angles and numbers of groups are whole or come from a table: equal ones are exactly equal.
    _, first, member = np.unique(
        np.stack(keys, axis=1), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    numbers = np.empty_like(order)
    numbers[order] = np.arange(order.size)
    return numbers[member.reshape(-1)], first[order]


def _summary(m: Measurements, member: IntArray, brdf: FloatArray) -> Repeats:
    counts = np.bincount(member)
    several = counts > 1
    rows = int(np.sum(counts[several]))
    freedom = rows - int(np.sum(several))
    unit = np.abs(np.mean(m.brdf)) if m.u_random is None else m.u_random
    with np.errstate(divide="ignore", invalid="ignore"):
        squares = np.square((m.brdf - brdf[member]) / unit)
    scatter = float(np.sqrt(np.sum(squares[several[member]]) / freedom)) if freedom else 0.0
    return Repeats(int(np.sum(several)), rows, scatter)
