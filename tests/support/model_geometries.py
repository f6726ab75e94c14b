"""Geometries at which tests of the models compare formulas."""

from __future__ import annotations

import numpy as np

from analysis.models.rough.form_error_table import LIMIT_DEG
from instrument.geometry import Geometry


def table_geometries(count: int) -> Geometry:
    """Random geometries (N,) in the error table's domain: in plane, equal angles, near grazing."""
    random = np.random.default_rng(7)
    theta_i, theta_r = random.uniform(0, LIMIT_DEG, (2, count))
    dphi = random.uniform(0, 360, count)
    dphi[::5], dphi[1::5] = 0, 180
    theta_r[::3] = theta_i[::3]
    theta_i[1::4] = random.uniform(75, LIMIT_DEG, theta_i[1::4].size)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
