"""White tile that is no perfect diffuser."""

from __future__ import annotations

import numpy as np
import pytest

from instrument.config.load import Loaded
from instrument.config.rig import SimulatedTile
from instrument.geometry import Geometry
from sim.defects.tile import radiance_factor
from sim.scene.render import electrons_per_s
from tests.support.scans import simulated_scene
from tests.support.white_tiles import SPECTRALON, with_tile

# Sintered PTFE at 532 nm times its 8 deg/hemispherical reflectance, seen 10 deg off the normal on
# the lamp's side (dphi 0) and the other: the fit of Germer, Applied Optics 56 (2017) 9333.
PTFE = {(0, 0): 1.053, (30, 0): 1.026, (30, 180): 1.026, (60, 0): 0.950, (60, 180): 0.972}


@pytest.mark.parametrize("angles", PTFE)
def test_a_tile_like_sintered_ptfe_is_as_published(angles: tuple[int, int]) -> None:
    theta_i, dphi = angles
    found = radiance_factor(
        Geometry.from_degrees(theta_i=theta_i, theta_r=10.0, dphi=dphi), SPECTRALON
    )
    assert found == pytest.approx(PTFE[angles], rel=0.02)


def test_lamp_and_camera_may_change_places() -> None:
    random = np.random.default_rng(18)
    a, b = random.uniform(0, 90, (2, 100))
    dphi = random.uniform(0, 360, 100)
    there = radiance_factor(Geometry.from_degrees(theta_i=a, theta_r=b, dphi=dphi), SPECTRALON)
    back = radiance_factor(Geometry.from_degrees(theta_i=b, theta_r=a, dphi=dphi), SPECTRALON)
    np.testing.assert_allclose(there, back)
    assert np.all(there >= 0)


def test_the_picture_of_the_tile_is_that_of_its_radiance_factor(demo: Loaded) -> None:
    tile = demo.protocol.references.white_tile
    assert tile is not None
    levels = {}
    for theta_i in (0.0, 60.0):
        for true in (SPECTRALON, SimulatedTile()):
            scene = simulated_scene(with_tile(demo, tile, true), theta_i)
            scene.surface = "white tile"
            levels[theta_i, true.falloff] = electrons_per_s(scene)[250:260, 310:320].mean()
    ratios = [levels[t, 0.18] / levels[t, 0.0] for t in (0.0, 60.0)]
    assert ratios == pytest.approx([1.057, 1.057 * (1 - 0.18 * 0.5)], rel=2e-3)
