"""The plan: whole, checked, in the order that asks least of the operator."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.plan.exposure_ladder import exposure_ladder_s, longest_exposure_s
from acquisition.plan.keep_out import enters_zone
from acquisition.plan.moves import moves_between
from acquisition.plan.plan import make_plan, min_separation_deg, sweep_poses
from acquisition.plan.pose import Pose, home_pose
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, Steps, WhiteTile
from instrument.config.rig import KeepOut, Rig
from instrument.errors import InputError
from instrument.geometry import camera_to_lamp_deg
from tests.support.paths import CONFIGS
from tests.support.scans import changed

TILE = WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0)


@pytest.fixture(scope="module")
def by_hand() -> Loaded:
    """The demo on the rig whose lamp is set by hand."""
    return load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml")


def _sweep(theta_i: list[float], theta_r: list[float], dphi: float = 0.0) -> dict[str, object]:
    return {"theta_i_deg": theta_i, "dphi_deg": [dphi], "theta_r_deg": theta_r}


def _poses(loaded: Loaded) -> list[Pose]:
    return [step.pose for step in make_plan(loaded).points]


def test_the_demo_measures_every_visible_geometry_once(demo: Loaded) -> None:
    plan = make_plan(demo)
    poses = [step.pose for step in plan.points]
    assert len(poses) == len(set(poses)) == 3 * 33 - len(plan.hidden)
    assert plan.hidden == (Pose(30, 0, 30), Pose(45, 0, 45), Pose(60, 0, 60))


@settings(max_examples=25, deadline=None)
@given(
    incidences=st.integers(1, 4),
    azimuths=st.integers(1, 3),
    views=st.integers(2, 20),
)
def test_each_geometry_is_visited_once_or_counted_as_hidden(
    incidences: int, azimuths: int, views: int
) -> None:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml")
    sweep = {
        "theta_i_deg": [10.0 + 20 * n for n in range(incidences)],
        "dphi_deg": [45.0 * n for n in range(azimuths)],
        "theta_r_deg": Steps(start=-80.0, stop=80.0, num=views),
    }
    plan = make_plan(changed(demo, sweeps=[sweep], references=References()))
    seen = [step.pose for step in plan.points] + list(plan.hidden)
    assert len(seen) == len(set(seen)) == incidences * azimuths * views
    limit = min_separation_deg(demo.rig)
    apart = [float(camera_to_lamp_deg(p.theta_i, p.theta_r, p.dphi)) for p in plan.hidden]
    assert all(angle < limit for angle in apart)


def test_the_inner_axis_runs_to_and_fro(demo: Loaded) -> None:
    poses = _poses(changed(demo, sweeps=[_sweep([30.0, 45.0], [-20.0, 0.0, 20.0])]))
    assert [p.theta_r for p in poses] == [-20, 0, 20, 20, 0, -20]


def test_the_slowest_axis_is_the_one_written_first_unless_it_is_a_motor_before_a_hand(
    demo: Loaded, by_hand: Loaded
) -> None:
    views_first = {"theta_r_deg": [0.0, 20.0], "theta_i_deg": [40.0, 60.0], "dphi_deg": [0.0]}
    motors = sweep_poses(views_first, demo.rig)
    assert [p.theta_r for p in motors] == [0, 0, 20, 20]
    hands = sweep_poses(views_first, by_hand.rig)
    assert [p.theta_i for p in hands] == [40, 40, 60, 60]


def test_the_operator_sets_the_lamp_once_for_each_incidence_and_swaps_as_seldom_as_can_be(
    demo: Loaded, by_hand: Loaded
) -> None:
    plan = make_plan(by_hand)
    set_by_hand = [m for s in plan.steps for m in s.moves if m.axis in ("theta_i", "dphi")]
    assert [(m.axis, m.angle_deg) for m in set_by_hand] == [
        ("theta_i", 30), ("dphi", 0), ("theta_i", 45), ("theta_i", 60),
    ]  # fmt: skip
    # tile, sample | sample, tile | tile, sample: each lamp setting with its own tile reading
    assert plan.swaps == 4
    assert plan.darks_first_s == exposure_ladder_s(by_hand.rig.camera)
    # With a motor for the lamp, tile and sample change places once.
    assert make_plan(demo).swaps == 2


def test_every_point_has_a_white_tile_reading_under_the_same_lamp(by_hand: Loaded) -> None:
    steps = make_plan(by_hand).steps
    tiles = {s.lamp_setting: s for s in steps if s.kind == "tile"}
    for step in steps:
        tile = tiles[step.lamp_setting]
        assert (tile.block, tile.pose.theta_i) == (step.block, step.pose.theta_i)


def test_drift_checks_enclose_the_points_and_repeat_one_geometry(demo: Loaded) -> None:
    steps = [s for s in make_plan(demo).steps if s.surface == "sample"]
    checks = [n for n, s in enumerate(steps) if s.kind == "drift"]
    assert checks[0] == 0
    assert checks[-1] == len(steps) - 1
    assert len({steps[n].pose for n in checks}) == 1
    assert max(b - a for a, b in pairwise(checks)) <= 26


def test_a_reference_that_the_lamp_hides_is_refused(demo: Loaded) -> None:
    references = References(
        white_tile=TILE.model_copy(update={"theta_r_deg": 45.0}),
        drift_check=DriftCheck(theta_r_deg=29.0),
    )
    with pytest.raises(InputError) as error:
        make_plan(changed(demo, references=references))
    text = str(error.value)
    assert "white_tile.theta_r_deg: 45 deg is hidden by the lamp at theta_i 45 deg" in text
    assert "drift_check.theta_r_deg: 29 deg is hidden by the lamp at theta_i 30 deg" in text
    assert f"{demo.protocol_path}:18:70: " in text  # where the tile's angle stands


def test_nothing_visible_is_refused(demo: Loaded) -> None:
    with pytest.raises(InputError, match="hide one another"):
        make_plan(changed(demo, sweeps=[_sweep([30.0], [30.0])]))


def test_the_solid_angles_say_what_is_hidden_unless_the_housings_are_wider(
    by_hand: Loaded, demo: Loaded
) -> None:
    # 0.003 sr is a cone of half-angle 1.771 deg, 0.0009 sr of 0.970 deg.
    bare = by_hand.rig.model_copy(update={"blocked_half_angle_deg": None})
    assert min_separation_deg(bare) == pytest.approx(2.741, abs=1e-3)
    assert min_separation_deg(demo.rig) == 3.0


def test_angles_are_approached_from_below(demo: Loaded) -> None:
    down = moves_between(Pose(30, 0, 40), Pose(30, 0, 20), demo.rig)
    assert [(m.axis, m.angle_deg) for m in down] == [("theta_r", 19.5), ("theta_r", 20)]
    up = moves_between(Pose(30, 0, 20), Pose(30, 0, 40), demo.rig)
    assert [(m.axis, m.angle_deg) for m in up] == [("theta_r", 40)]


def _with_zone(rig: Rig, **zone: object) -> Rig:
    return rig.model_copy(update={"keep_out": [KeepOut(name="zone", **zone)]})  # type: ignore[arg-type]  # a test's shorthand


def test_the_whole_path_is_checked_and_not_only_its_end(demo: Loaded) -> None:
    post = _with_zone(demo.rig, theta_r_deg=[10.0, 12.0])
    with pytest.raises(InputError, match=r"move of theta_r from .* meets the keep-out zone 'zone'"):
        make_plan(changed(demo, rig={"keep_out": post.keep_out}))


def test_the_beam_does_not_meet_the_lamp(demo: Loaded) -> None:
    lamp = _with_zone(demo.rig, camera_to_lamp_deg=2.0)
    start, end = Pose(45, 0, 30), Pose(45, 0, 60)
    with pytest.raises(InputError, match="keep-out zone"):
        moves_between(start, end, lamp)
    # Out of the lamp's plane the same swing is free.
    assert moves_between(start._replace(dphi=30), end._replace(dphi=30), lamp)


def test_another_order_of_the_axes_is_taken_when_it_is_clear(demo: Loaded) -> None:
    # theta_i first would cross the camera at 40; theta_r first is free.
    lamp = _with_zone(demo.rig, camera_to_lamp_deg=2.0)
    moves = moves_between(Pose(30, 0, 40), Pose(60, 0, 70), lamp)
    assert [m.axis for m in moves] == ["theta_r", "theta_i"]


@given(
    theta_i=st.floats(5, 80), dphi=st.floats(0, 180), start=st.floats(-85, 85),
    end=st.floats(-85, 85), cone=st.floats(0.5, 10),
)  # fmt: skip
def test_the_closest_approach_is_not_missed(
    theta_i: float, dphi: float, start: float, end: float, cone: float
) -> None:
    zone = KeepOut(name="lamp", camera_to_lamp_deg=cone)
    sampled = min(
        float(camera_to_lamp_deg(theta_i, start + (end - start) * n / 400, dphi))
        for n in range(401)
    )
    met = enters_zone(zone, Pose(theta_i, dphi, start), Pose(theta_i, dphi, end), "theta_r")
    assert met or sampled >= cone
    assert not met or sampled < cone + 0.25  # half a sample's step


def test_an_axis_without_room_for_its_backlash_is_named(demo: Loaded) -> None:
    with pytest.raises(InputError, match=r"theta_r would go to -88.2 deg .* limits are -88 to 88"):
        moves_between(Pose(30, 0, 0), Pose(30, 0, -87.7), demo.rig)


def test_after_homing_a_hand_set_axis_stands_nobody_knows_where(by_hand: Loaded) -> None:
    pose = home_pose(by_hand.rig)
    assert pose.theta_i != pose.theta_i
    assert pose.theta_r == 0.0


def test_exposures_come_from_one_ladder_within_the_cameras_range(demo: Loaded) -> None:
    camera = demo.rig.camera
    ladder = exposure_ladder_s(camera)
    assert ladder[0] == camera.min_exposure_s
    assert ladder[-1] <= camera.max_exposure_s
    assert all(b / a == pytest.approx(2**0.5, rel=1e-5) for a, b in pairwise(ladder))
    assert all(longest_exposure_s(exposure, camera) == exposure for exposure in ladder)
    assert longest_exposure_s(1e-9, camera) == ladder[0]


def test_the_lamp_is_set_once_by_hand_for_all_sweeps(by_hand: Loaded) -> None:
    sweeps = [_sweep([30.0, 50.0], [-60.0, 0.0]), _sweep([30.0, 50.0], [60.0, 70.0])]
    plan = make_plan(changed(by_hand, sweeps=sweeps))
    hands = [m.angle_deg for s in plan.steps for m in s.moves if m.axis == "theta_i"]
    assert hands == [30, 50]
    assert len(plan.points) == 8


def test_the_way_of_the_hand_is_checked_too(by_hand: Loaded) -> None:
    lamp = _with_zone(by_hand.rig, camera_to_lamp_deg=8.0)
    with pytest.raises(InputError, match="theta_i from 30 to 70 deg meets the keep-out zone"):
        moves_between(Pose(30, 0, 60), Pose(70, 0, 60), lamp)
    # The camera goes first where that clears the way.
    moves = moves_between(Pose(30, 0, 60), Pose(70, 0, 80), lamp)
    assert [m.axis for m in moves] == ["theta_r", "theta_i"]


def test_one_line_for_each_thing_in_the_way(demo: Loaded) -> None:
    zone = KeepOut(name="post", theta_r_deg=[10.0, 12.0])
    with pytest.raises(InputError) as error:
        make_plan(changed(demo, rig={"keep_out": [zone]}))
    (problem,) = error.value.problems
    assert problem.startswith(f"{demo.protocol_path}:9:3: sweeps: the move of theta_r from")
    assert "other moves" in problem


def test_a_blocked_angle_narrower_than_lamp_and_lens_counts_as_theirs(by_hand: Loaded) -> None:
    narrow = by_hand.rig.model_copy(update={"blocked_half_angle_deg": 0.5})
    assert min_separation_deg(narrow) == pytest.approx(2.741, abs=1e-3)
