"""Geometries spread over a list."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.design.space_filling import farthest
from instrument.geometry import Geometry


def test_three_of_a_sweep_are_its_middle_and_its_ends() -> None:
    views = np.linspace(-60.0, 60.0, 25)
    chosen = farthest(Geometry.from_degrees(theta_i=30.0, theta_r=views), 3)
    assert views[chosen].tolist() == [-60.0, 0.0, 60.0]


@pytest.mark.parametrize("seed", range(3))
def test_no_candidate_is_farther_from_the_chosen_than_they_are_from_one_another(seed: int) -> None:
    rng = np.random.default_rng(seed)
    views, azimuths = rng.uniform(0, 80, 60), rng.uniform(0, 360, 60)
    geometry = Geometry.from_degrees(theta_i=30.0, theta_r=views, dphi=azimuths)
    chosen = farthest(geometry, 9)
    polar, azimuth = np.radians(views), np.radians(azimuths)
    at = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1
    )
    apart = np.linalg.norm(at[:, np.newaxis] - at[chosen], axis=2)
    among = apart[chosen] + 10 * np.eye(9)
    assert apart.min(axis=1).max() <= among.min() + 1e-9


def test_none_is_none() -> None:
    assert not farthest(Geometry.from_degrees(theta_i=30.0, theta_r=[0.0, 10.0]), 0).any()
