"""Drawn benches of the study of corrections: what is left out is left out, the rest is the same."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.benchmark.corrections.real_bench import (
    TILE_VIEW_DEG,
    Corrections,
    certified_factor,
    real_bench,
)
from instrument.geometry import Geometry
from sim.defects.tile import radiance_factor
from tests.support.white_tiles import SPECTRALON


def test_the_certificate_states_what_the_simulated_tile_was_when_new() -> None:
    theta_i = np.random.default_rng(5).uniform(0, 80, 30)
    for dphi in (0.0, 70.0, 180.0):
        angles = Geometry.from_degrees(theta_i=theta_i, theta_r=TILE_VIEW_DEG, dphi=dphi)
        stated = certified_factor(SPECTRALON, theta_i, dphi)
        assert stated == pytest.approx(radiance_factor(angles, SPECTRALON), rel=1e-12)


def test_a_seed_is_the_same_bench_whatever_is_corrected() -> None:
    all_corrections = real_bench(7, Corrections())
    for left in (Corrections(tile_table=False), Corrections(drift_checks=False)):
        assert real_bench(7, left).rig == all_corrections.rig
    without = real_bench(7, Corrections(lines={"vignetting": 0.0})).rig
    assert without.simulation == all_corrections.rig.simulation
    assert without.uncertainty.vignetting == 0.0
    assert without.uncertainty.wall_light == all_corrections.rig.uncertainty.wall_light > 0


def test_a_dark_patch_takes_the_place_of_the_stated_stray_light() -> None:
    rig = real_bench(7, Corrections(dark_patch=True)).rig
    assert rig.camera.dark_patch is not None
    assert rig.uncertainty.stray_light == rig.uncertainty.u_stray_light == 0.0
