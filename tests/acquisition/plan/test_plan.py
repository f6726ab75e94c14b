"""Plan: complete, checked, in the order that asks least of the operator."""

from __future__ import annotations

from collections import Counter
from itertools import groupby, pairwise, product

import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from acquisition.plan.exposure_ladder import exposure_ladder_s
from acquisition.plan.moves import moves_between
from acquisition.plan.plan import Plan, Step, make_plan, min_separation_deg, sweep_poses
from acquisition.plan.pose import Pose, home_pose
from instrument.config.axes import AXES, HandAxis
from instrument.config.load import Loaded
from instrument.config.protocol import DriftCheck, References, Steps, WhiteTile
from instrument.config.rig import KeepOut, Rig
from instrument.errors import InputError
from tests.support.random_plans import base, follow, scans, separation_deg
from tests.support.scans import changed

TILE = WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0)
REFUSALS = "hide one another|is hidden by the lamp|meets the keep-out zone|its limits are"


@pytest.fixture(scope="module")
def by_hand() -> Loaded:
    """The demo on the rig whose lamp is set by hand."""
    return base("paper_1995")


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
    demo = base("bench_12bit")
    sweep = {
        "theta_i_deg": [10.0 + 20 * n for n in range(incidences)],
        "dphi_deg": [45.0 * n for n in range(azimuths)],
        "theta_r_deg": Steps(start=-80.0, stop=80.0, num=views),
    }
    plan = make_plan(changed(demo, sweeps=[sweep], references=References()))
    planned = [step.pose for step in plan.points] + list(plan.hidden)
    assert len(planned) == len(set(planned)) == incidences * azimuths * views
    limit_deg = min_separation_deg(demo.rig)
    assert all(separation_deg(pose) < limit_deg for pose in plan.hidden)


def test_the_inner_axis_alternates_its_direction(demo: Loaded) -> None:
    poses = _poses(changed(demo, sweeps=[_sweep([30.0, 45.0], [-20.0, 0.0, 20.0])]))
    assert [p.theta_r for p in poses] == [-20, 0, 20, 20, 0, -20]


def test_the_axis_written_first_is_slowest_unless_it_is_a_motor_before_a_hand_set_axis(
    demo: Loaded, by_hand: Loaded
) -> None:
    views_first = {"theta_r_deg": [0.0, 20.0], "theta_i_deg": [40.0, 60.0], "dphi_deg": [0.0]}
    motors = sweep_poses(views_first, demo.rig)
    assert [p.theta_r for p in motors] == [0, 0, 20, 20]
    hands = sweep_poses(views_first, by_hand.rig)
    assert [p.theta_i for p in hands] == [40, 40, 60, 60]


def test_the_operator_sets_the_lamp_once_an_incidence_and_swaps_as_rarely_as_possible(
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
    # With a motor for the lamp, tile and sample are swapped once.
    assert make_plan(demo).swaps == 2


def test_every_point_has_a_white_tile_reading_under_the_same_lamp(by_hand: Loaded) -> None:
    steps = make_plan(by_hand).steps
    tiles = {s.lamp_setting: s for s in steps if s.kind == "tile"}
    for step in steps:
        tile = tiles[step.lamp_setting]
        assert (tile.block, tile.pose.theta_i) == (step.block, step.pose.theta_i)


def test_a_tile_that_is_read_again_encloses_each_block(demo: Loaded, by_hand: Loaded) -> None:
    tile = TILE.model_copy(update={"again_at_end": True})
    for loaded, swaps in ((demo, 3), (by_hand, 7)):
        plan = make_plan(changed(loaded, references=References(white_tile=tile)))
        assert plan.swaps == swaps
        for _, block in groupby(plan.steps, lambda step: step.block):
            kinds = [(kind, [s.pose for s in steps]) for kind, steps in
                     groupby(block, lambda step: step.kind)]  # fmt: skip
            assert [kind for kind, _ in kinds] == ["tile", "point", "tile"]
            assert kinds[0][1] == kinds[2][1]


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
    assert f"{demo.protocol_path}:18:70: " in text  # the position of the tile's angle


def test_a_protocol_without_visible_geometry_is_refused(demo: Loaded) -> None:
    with pytest.raises(InputError, match="hide one another"):
        make_plan(changed(demo, sweeps=[_sweep([30.0], [30.0])]))


def test_the_solid_angles_say_what_is_hidden_unless_the_housings_are_wider(
    by_hand: Loaded, demo: Loaded
) -> None:
    # 0.003 sr is a cone of half-angle 1.771 deg, 0.0009 sr of 0.970 deg.
    bare = by_hand.rig.model_copy(update={"blocked_half_angle_deg": None})
    assert min_separation_deg(bare) == pytest.approx(2.741, abs=1e-3)
    assert min_separation_deg(demo.rig) == 3.0


def test_a_blocked_angle_narrower_than_lamp_and_lens_counts_as_theirs(by_hand: Loaded) -> None:
    narrow = by_hand.rig.model_copy(update={"blocked_half_angle_deg": 0.5})
    assert min_separation_deg(narrow) == pytest.approx(2.741, abs=1e-3)


def test_the_whole_path_is_checked_and_not_only_its_end(demo: Loaded) -> None:
    post = KeepOut(name="zone", theta_r_deg=[10.0, 12.0])
    with pytest.raises(InputError, match=r"move of theta_r from .* meets the keep-out zone 'zone'"):
        make_plan(changed(demo, rig={"keep_out": [post]}))


def test_each_obstacle_is_reported_in_one_line(demo: Loaded) -> None:
    zone = KeepOut(name="post", theta_r_deg=[10.0, 12.0])
    with pytest.raises(InputError) as error:
        make_plan(changed(demo, rig={"keep_out": [zone]}))
    (problem,) = error.value.problems
    assert problem.startswith(f"{demo.protocol_path}:9:3: sweeps: the move of theta_r from")
    assert "other moves" in problem


def test_the_lamp_is_set_once_by_hand_for_all_sweeps(by_hand: Loaded) -> None:
    sweeps = [_sweep([30.0, 50.0], [-60.0, 0.0]), _sweep([30.0, 50.0], [60.0, 70.0])]
    plan = make_plan(changed(by_hand, sweeps=sweeps))
    hands = [m.angle_deg for s in plan.steps for m in s.moves if m.axis == "theta_i"]
    assert hands == [30, 50]
    assert len(plan.points) == 8


def test_the_planned_moves_serve_from_the_planned_pose_only(demo: Loaded) -> None:
    plan, rig = make_plan(demo), demo.rig
    first, second = plan.steps[:2]
    assert plan.moves_to(first, home_pose(rig), rig) is first.moves
    assert plan.moves_to(second, first.pose, rig) is second.moves
    elsewhere = first.pose._replace(theta_r=first.pose.theta_r - 7.0)
    moves = plan.moves_to(second, elsewhere, rig)
    assert moves == moves_between(elsewhere, second.pose, rig) != second.moves


@pytest.mark.slow
def test_any_plan_keeps_what_it_promises(slow: bool) -> None:
    """What can be planned is planned as promised; what cannot is refused with the obstacle."""

    @settings(max_examples=5000 if slow else 60, derandomize=not slow)
    @given(scans())
    def holds(loaded: Loaded) -> None:
        try:
            plan = make_plan(loaded)
        except InputError as refused:
            event("refused")
            with pytest.raises(InputError, match=REFUSALS):
                raise refused
            return
        event("planned")
        every_visible_geometry_is_a_point_once(plan, loaded)
        the_references_are_as_promised(plan, loaded)
        every_move_is_clear(plan, loaded.rig)

    holds()


def requested(loaded: Loaded) -> list[Pose]:
    return [
        Pose(theta_i, dphi, theta_r)
        for sweep in loaded.protocol.sweeps
        for theta_i, dphi, theta_r in product(*(sweep[f"{name}_deg"] for name in AXES))
    ]


def visible(pose: Pose, loaded: Loaded) -> bool:
    return separation_deg(pose) >= min_separation_deg(loaded.rig)


def every_visible_geometry_is_a_point_once(plan: Plan, loaded: Loaded) -> None:
    points = Counter(step.pose for step in plan.points)
    assert points == Counter(pose for pose in requested(loaded) if visible(pose, loaded))
    assert Counter(plan.hidden) == Counter(p for p in requested(loaded) if not visible(p, loaded))
    assert set(points.values()) == {1}
    assert [step.index for step in plan.steps] == list(range(len(plan.steps)))
    assert all(visible(step.pose, loaded) for step in plan.steps)


def the_references_are_as_promised(plan: Plan, loaded: Loaded) -> None:
    tile, drift = loaded.protocol.references.white_tile, loaded.protocol.references.drift_check
    tiles = [step for step in plan.steps if step.kind == "tile"]
    settings_ = {step.lamp_setting: step.pose[:2] for step in plan.points}
    if tile is None:
        assert not tiles
    else:  # one or two readings for every position of the lamp, in the same setting by hand
        times = 1 + tile.again_at_end
        assert Counter(step.lamp_setting for step in tiles) == Counter(times * list(settings_))
        block = {step.lamp_setting: step.block for step in plan.points}
        for step in tiles:
            assert step.pose == Pose(*settings_[step.lamp_setting], tile.theta_r_deg)
            assert (step.block, step.surface) == (block[step.lamp_setting], "white tile")
    by_hand = [n for n in ("theta_i", "dphi") if isinstance(loaded.rig.axes[n], HandAxis)]
    for _, steps in groupby(plan.steps, key=lambda step: step.block):
        own = list(steps)  # a block is one run of steps, and one setting by hand
        assert len({tuple(getattr(step.pose, n) for n in by_hand) for step in own}) == 1
        _the_checks_enclose(own, drift)
    blocks = [number for number, _ in groupby(plan.steps, key=lambda step: step.block)]
    assert blocks == list(range(len(blocks)))


def _the_checks_enclose(own: list[Step], drift: DriftCheck | None) -> None:
    """One geometry, before the block's first point and after its last, and often enough."""
    kinds = [step.kind for step in own if step.surface == "sample"]
    if drift is None:
        assert set(kinds) == {"point"}
        return
    assert (kinds[0], kinds[-1]) == ("drift", "drift")
    assert len({step.pose for step in own if step.kind == "drift"}) == 1
    between = [len(list(run)) for kind, run in groupby(kinds) if kind == "point"]
    assert max(between) <= drift.every_points
    assert all(n == drift.every_points for n in between[:-1])


def every_move_is_clear(plan: Plan, rig: Rig) -> None:
    """Followed from home, one axis at a time: within limits, past no zone, to the planned pose."""
    pose = home_pose(rig)
    for step in plan.steps:
        pose = follow(pose, step.moves, rig)
        assert pose == step.pose
