"""Common geometries: the same directions however they are written, and no others."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analysis.comparison.common_geometries import SAME_DEG, common_geometries
from analysis.data.measurements import Measurements
from instrument.geometry import FloatArray


def measured(angles: FloatArray) -> Measurements:
    theta_i, theta_r, dphi = angles.T
    return Measurements.bare(theta_i, theta_r, dphi, np.ones(len(angles)))


angle_grid = st.lists(
    st.tuples(st.integers(0, 8), st.integers(-8, 8), st.integers(0, 17)), min_size=1, max_size=30,
    unique=True,
)  # fmt: skip


def directions(angles: FloatArray) -> list[tuple[float, ...]]:
    """Geometries of both runs, in the convention of positive theta_r and dphi below 360."""
    g = measured(angles).geometry
    at_normal = (g.theta_i_deg < 1) | (g.theta_r_deg < 1)
    dphi = np.where(at_normal, 0.0, np.round(g.dphi_deg) % 360)
    found = np.stack([np.round(g.theta_i_deg), np.round(g.theta_r_deg), dphi], axis=-1)
    return [tuple(row) for row in found.tolist()]


@given(first=angle_grid, second=angle_grid, seed=st.integers(0, 99))
def test_the_directions_of_both_are_found_whatever_their_order_and_sign(
    first: list[tuple[int, int, int]], second: list[tuple[int, int, int]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    a, b = (np.array(angles) * (10.0, 10.0, 20.0) for angles in (first, second))
    turned = rng.random(len(b)) < 0.5  # (-theta_r, dphi + 180) is the same direction
    b[turned] = b[turned] * (1, -1, 1) + (0, 0, 180)
    b[:, :2] += rng.uniform(-0.3, 0.3, (len(b), 2)) * SAME_DEG
    b[:, 0] = np.clip(b[:, 0], 0, 90)
    found = common_geometries([measured(a), measured(b)])
    shared = set(directions(a)) & set(directions(b))
    assert {directions(a)[n] for n in found[0]} == shared
    assert [directions(a)[n] for n in found[0]] == [directions(b)[n] for n in found[1]]
    assert len(found[0]) == len(shared)


def test_a_neighbour_is_another_geometry() -> None:
    a = np.array([[30.0, 10.0, 0.0]])
    b = a + np.array([0.0, 2.5 * SAME_DEG, 0.0])
    assert common_geometries([measured(a), measured(b)])[0].size == 0
