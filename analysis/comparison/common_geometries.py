"""Geometries that several measurements have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.data.measurements import Measurements
from instrument.geometry import FloatArray, IntArray

# Two settings of one geometry differ by the rounding of their axes, two geometries by more.
SAME_DEG = 0.05


def common_geometries(runs: Sequence[Measurements]) -> list[IntArray]:
    """Return, for each run, the indices (G,) of its points at the G geometries that all have.

    They are in the order of the first run. Angles are the same within `SAME_DEG`, and dphi does not
    count where the lamp or the camera stands at the normal. Of repeats the first one counts.
    """
    from scipy.spatial import cKDTree  # heavy

    first, *others = (_places(m) for m in runs)
    kept = _without_repeats(first)
    found = [kept]
    for places in others:
        tree = cKDTree(places)
        distance, index = map(
            np.asarray, tree.query(first[found[0]], distance_upper_bound=SAME_DEG)
        )
        near = np.isfinite(distance)
        found = [indices[near] for indices in found] + [index[near].astype(np.int64)]
    return found


def _places(m: Measurements) -> FloatArray:
    """Geometries as points (N, 3) whose distances are about those of the angles, in degrees."""
    g = m.geometry
    at_normal = g.theta_i_deg < SAME_DEG  # there dphi is arbitrary
    x = np.where(at_normal, 1.0, g.cos_dphi)
    y = np.where(at_normal, 0.0, np.sin(np.radians(g.dphi_deg)))
    return np.stack([g.theta_i_deg, g.theta_r_deg * x, g.theta_r_deg * y], axis=-1)


def _without_repeats(places: FloatArray) -> IntArray:
    """Indices of the points that are no repeats of an earlier one."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(places).query_pairs(SAME_DEG, output_type="ndarray")
    return np.setdiff1d(np.arange(len(places)), pairs.max(axis=1) if pairs.size else pairs)
