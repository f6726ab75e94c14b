"""Flights: speeds within all limits, whole sweeps, and what cannot be flown."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import numpy as np
import pytest

from acquisition.plan.flight import (
    frame_time_s,
    in_turns,
    largest_blur_deg,
    make_flight,
    runs,
)
from acquisition.plan.plan import make_plan
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, FlyConfig, GoalConfig, References, Steps
from instrument.errors import InputError
from tests.support.flights.fly_scans import fly_scan
from tests.support.paths import CONFIGS
from tests.support.scans import changed


@pytest.fixture(scope="module")
def flown() -> Loaded:
    return fly_scan(33)


def test_the_largest_blur_lowers_the_peak_of_the_narrowest_lobe_by_u() -> None:
    """The mean of a Gaussian over the blur, by a sum, against its peak."""
    chosen = random.Random(1)
    for _ in range(20):
        fly = FlyConfig(
            narrowest_lobe_deg=chosen.uniform(0.5, 30), u_blur=chosen.uniform(1e-4, 0.01)
        )
        sigma = fly.narrowest_lobe_deg / math.sqrt(8 * math.log(2))
        within = np.linspace(-0.5, 0.5, 20_001) * largest_blur_deg(fly)
        lowered = 1 - np.mean(np.exp(-((within / sigma) ** 2) / 2))
        assert lowered == pytest.approx(fly.u_blur, rel=0.02)


def test_a_flight_is_as_fast_as_blur_frames_axis_and_room_allow(flown: Loaded) -> None:
    chosen, rig = random.Random(2), flown.rig
    axis = rig.axes.theta_r
    for _ in range(100):
        ends = sorted(chosen.uniform(-85, 85) for _ in range(2))
        number, exposure_s = chosen.randint(2, 200), chosen.uniform(0.001, 1.0)
        fly = FlyConfig(narrowest_lobe_deg=chosen.uniform(0.5, 50))
        angles = np.linspace(*ends[:: chosen.choice([1, -1])], number).tolist()
        flight = make_flight([Pose(30.0, 0.0, a) for a in angles], exposure_s, rig, fly)
        speed = flight.speed_deg_per_s
        assert speed <= axis.speed_deg_per_s
        assert speed * exposure_s <= largest_blur_deg(fly) * (1 + 1e-9)
        spacing = abs(angles[1] - angles[0])
        assert speed * frame_time_s(exposure_s, rig) <= spacing
        ramp_deg = speed**2 / (2 * axis.acceleration_deg_per_s2)
        for end, at in ((flight.start, angles[0]), (flight.end, angles[-1])):
            assert abs(end.theta_r - at) >= ramp_deg
            assert axis.min_deg <= end.theta_r <= axis.max_deg
            assert end.theta_r > -87.0  # the keep-out zone of the rig file begins there


def test_a_sweep_is_flown_whole_and_drift_checks_stand_between(flown: Loaded) -> None:
    often = References(drift_check=DriftCheck(theta_r_deg=10.0, every_points=5))
    for loaded in (flown, changed(flown, references=often)):
        steps = make_plan(loaded).steps
        flights = [g for g in in_turns(steps) if g[0].flight is not None]
        assert len(flights) == 2  # incidences
        assert [g[0].flight for g in flights] == [0, 1]
        for group in flights:
            rising = {b.pose.theta_r > a.pose.theta_r for a, b in pairwise(group)}
            assert len(rising) == 1
        assert all(s.flight is None for s in steps if s.kind != "point")
    kinds = [group[0].kind for group in in_turns(steps)]
    assert kinds == ["drift", "point", "drift", "point", "drift"]


def test_poses_split_into_runs_at_the_lamp_and_where_they_turn_round() -> None:
    poses = [Pose(30.0, 0.0, a) for a in (0.0, 1.0, 2.0)] + [Pose(30.0, 0.0, a) for a in (1.5, 1.0)]
    poses += [Pose(40.0, 0.0, a) for a in (1.0, 2.0)]
    assert runs(poses) == [0, 3, 5]
    assert runs([]) == []


def test_what_cannot_be_flown_is_refused_at_plan(flown: Loaded) -> None:
    sweep = flown.protocol.sweeps[0]
    hand = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml")
    by_hand = hand.rig.axes.theta_i
    axes = flown.rig.axes.model_copy(update={"theta_r": by_hand})
    cases = {
        r"the driver hand of theta_r cannot report its position while it moves": changed(
            flown, rig={"axes": axes}
        ),
        r"frames_per_point: 4; allowed with motion: fly: 1": changed(flown, frames_per_point=4),
        r"theta_i_deg is the last axis": changed(
            flown, sweeps=[{k: sweep[k] for k in ("dphi_deg", "theta_r_deg", "theta_i_deg")}]
        ),
        r"theta_r_deg has 2 angles": changed(
            flown, sweeps=[sweep | {"theta_r_deg": Steps(start=0.0, stop=9.0, num=2)}]
        ),
        r"each larger than the one before": changed(
            flown, sweeps=[sweep | {"theta_r_deg": [0.0, 20.0, 10.0]}]
        ),
        r"motion: fly, and a goal": changed(flown, goal={"albedo": GoalConfig(u=0.01)}),
        r"to reach a steady speed": changed(
            flown, sweeps=[sweep | {"theta_r_deg": Steps(start=0.0, stop=88.0, num=9)}]
        ),
    }
    for text, loaded in cases.items():
        with pytest.raises(InputError, match=text):
            make_plan(loaded)


def test_a_stepped_plan_has_no_flights(flown: Loaded) -> None:
    plan = make_plan(changed(flown, motion="stepped"))
    assert all(step.flight is None for step in plan.steps)
