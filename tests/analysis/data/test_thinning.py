"""Part of very many measurements: evenly spread, with the peaks of lobes that lie between."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.data.thinning import thinned
from instrument.geometry import FloatArray


def drawn(seed: int, size: int, u_relative: float | None) -> Measurements:
    """Return points of a smooth surface at random angles, in random order."""
    draw = np.random.default_rng(seed)
    theta_i, theta_r = draw.uniform(0, 80, size).round(-1), draw.uniform(-80, 80, size)
    brdf: FloatArray = 0.3 * np.cos(np.radians(theta_r / 2)) * draw.normal(1, 0.01, size)
    u = None if u_relative is None else u_relative * brdf
    return Measurements.bare(theta_i, theta_r, 0.0, brdf, u)


def test_few_points_are_all_kept() -> None:
    m = drawn(1, 500, 0.01)
    assert thinned(m, 500) is m


@pytest.mark.parametrize("seed", range(5))
def test_the_part_has_as_many_points_as_asked_and_is_as_dense_everywhere(seed: int) -> None:
    m = drawn(seed, 7000, 0.01)
    part = thinned(m, 700)
    assert part.size == 700
    for angles, of_part in ((m.theta_i_deg, part.theta_i_deg), (m.theta_r_deg, part.theta_r_deg)):
        edges = np.linspace(angles.min(), angles.max() + 1e-9, 9)
        share = np.histogram(of_part, edges)[0] / np.histogram(angles, edges)[0]
        assert share == pytest.approx(0.1, rel=0.25)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("u_relative", [0.01, None])
def test_a_single_point_that_stands_out_is_in_the_part_with_a_larger_u(
    seed: int, u_relative: float | None
) -> None:
    m = drawn(seed, 7000, u_relative)
    peak = int(np.random.default_rng(seed).integers(m.size))
    m.brdf[peak] *= 1.5
    part = thinned(m, 700)
    (at,) = np.flatnonzero(part.brdf == m.brdf[peak])
    assert part.theta_r_deg[at] == m.theta_r_deg[peak]
    if m.u_random is not None and part.u_random is not None:
        assert part.u_random[at] == pytest.approx(m.u_random[peak] * np.sqrt(10), rel=0.01)
