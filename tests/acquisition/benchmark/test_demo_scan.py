"""The benchmark's demonstration is the shipped one, but for its binned camera."""

from __future__ import annotations

import pytest

from acquisition.benchmark.demo_scan import (
    BINNING,
    demonstration,
    shipped_demo,
    shipped_rig,
    view_step_deg,
)
from acquisition.plan.plan import make_plan
from instrument.config.load import load_protocol
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from tests.support.paths import CONFIGS


def test_the_demonstration_is_the_shipped_one() -> None:
    shipped = load_protocol(CONFIGS / "protocols" / "demo.yaml")
    assert shipped_demo().rig == shipped_rig(shipped.rig.name) == shipped.rig
    assert shipped_demo().protocol == shipped.protocol
    same = demonstration(views=33, frames=4, exposure_target=0.7, seed=2026)
    assert same.protocol == demonstration().protocol
    assert same.rig == demonstration().rig


def test_binned_pixels_hold_the_same_light() -> None:
    whole, binned = shipped_demo().rig, demonstration().rig
    assert binned.camera.width_px * BINNING == whole.camera.width_px
    rates = [r.lamp.white_electrons_per_s * r.camera.width_px**2 for r in (whole, binned)]
    assert rates[0] == rates[1]
    minutes = make_plan(demonstration()).duration_s
    shipped = make_plan(load_protocol(CONFIGS / "protocols" / "demo.yaml")).duration_s
    assert minutes == pytest.approx(shipped, rel=1e-9)


def test_other_settings_are_what_a_protocol_allows() -> None:
    loaded = demonstration(views=9, frames=1, exposure_target=0.05, seed=7)
    assert Protocol.model_validate(loaded.protocol.model_dump()) == loaded.protocol
    assert Rig.model_validate(loaded.rig.model_dump()) == loaded.rig
    assert loaded.protocol.frames_per_point == 1
    assert loaded.protocol.exposure_target == 0.05
    assert loaded.rig.simulation.seed == 7
    angles = {step.pose.theta_r for step in make_plan(loaded).points}
    assert max(angles) - min(angles) == 8 * view_step_deg(9) == 160
