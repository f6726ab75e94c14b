"""Whatever is asked of whatever rig: the plan visits every geometry once, and runs into nothing.

What can be planned is planned as promised; what cannot is refused with what stands in the way.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import cache
from itertools import groupby, product
from typing import Any

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from acquisition.plan.moves import SAME_ANGLE_DEG, Move, NoPathError, moves_between
from acquisition.plan.plan import Plan, Step, make_plan, min_separation_deg
from acquisition.plan.pose import Pose, home_pose
from instrument.config.axes import AXES, HandAxis
from instrument.config.load import Loaded, load_protocol
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.config.rig import KeepOut, Rig
from instrument.errors import InputError
from instrument.geometry import camera_to_lamp_deg
from tests.support.paths import CONFIGS
from tests.support.scans import changed

SAMPLES = 41  # places on the way of a move that are looked at
REFUSALS = "hide one another|is hidden by the lamp|meets the keep-out zone|its limits are"


@cache
def base(rig: str) -> Loaded:
    return load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / f"{rig}.yaml")


def angles(low: int, high: int, most: int) -> st.SearchStrategy[list[float]]:
    """Different angles in any order, in steps of half a degree."""
    halves = st.lists(st.integers(2 * low, 2 * high), min_size=1, max_size=most, unique=True)
    return halves.map(lambda found: [n / 2 for n in found])


def ranges(low: int, high: int) -> st.SearchStrategy[list[float]]:
    pair = st.tuples(st.integers(low, high), st.integers(0, 12))
    return pair.map(lambda ends: [float(ends[0]), float(ends[0] + ends[1])])


ZONES = st.one_of(
    st.builds(KeepOut, name=st.just("post"), theta_r_deg=ranges(-88, 76)),
    st.builds(KeepOut, name=st.just("arm"), theta_i_deg=ranges(0, 73), theta_r_deg=ranges(-88, 76)),
    st.builds(KeepOut, name=st.just("cable"), dphi_deg=ranges(0, 168), theta_r_deg=ranges(0, 76)),
    st.builds(KeepOut, name=st.just("lamp"), camera_to_lamp_deg=st.floats(0.5, 12.0)),
)


@st.composite
def scans(draw: st.DrawFn) -> Loaded:
    """Any protocol of up to two sweeps, on a rig with motors or with a lamp that is set by hand."""
    loaded = base(draw(st.sampled_from(["bench_12bit", "paper_1995"])))
    views = draw(angles(-87, 87, 9))
    cut = draw(st.integers(1, len(views)))  # two sweeps share no view angle
    sweeps = []
    for part in (views[:cut], views[cut:]):
        written: list[tuple[str, Any]] = [
            ("theta_i_deg", draw(angles(1, 84, 3))),
            ("dphi_deg", draw(angles(0, 180, 3))),
            ("theta_r_deg", part),
        ]
        sweeps.append(dict(draw(st.permutations(written))))
    reference_deg = st.integers(-60, 60).map(float)
    tile = draw(
        st.none()
        | st.builds(
            WhiteTile, reflectance=st.just(0.99), u_reflectance=st.just(0.005),
            theta_r_deg=reference_deg,
        )
    )  # fmt: skip
    drift = draw(
        st.none() | st.builds(DriftCheck, theta_r_deg=reference_deg, every_points=st.integers(1, 6))
    )
    return changed(
        loaded,
        rig={
            "keep_out": draw(st.lists(ZONES, max_size=2)),
            "blocked_half_angle_deg": draw(st.none() | st.floats(0.5, 15.0)),
        },
        sweeps=[sweep for sweep in sweeps if sweep["theta_r_deg"]],
        references=References(white_tile=tile, drift_check=drift),
    )


@pytest.mark.slow
def test_any_plan_keeps_what_it_promises(slow: bool) -> None:
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


POSES = st.builds(
    Pose, st.floats(1.0, 84.0), st.floats(1.0, 180.0), st.floats(-87.0, 87.0)
)  # each with room for the backlash below it


@pytest.mark.slow
def test_any_move_is_clear_whatever_the_order_of_its_axes(slow: bool) -> None:
    @settings(max_examples=20_000 if slow else 250, derandomize=not slow)
    @given(start=POSES, end=POSES, zones=st.lists(ZONES, min_size=1, max_size=3))
    def holds(start: Pose, end: Pose, zones: list[KeepOut]) -> None:
        rig = base("bench_12bit").rig.model_copy(update={"keep_out": zones})
        moves, cause = None, ""
        try:
            moves = moves_between(start, end, rig)
        except NoPathError as refused:
            cause = refused.cause
        if moves is None:
            assert cause in {f"keep-out zone {zone.name}" for zone in zones}
        else:
            assert follow(start, moves, rig) == pytest.approx(end, abs=2 * SAME_ANGLE_DEG)

    holds()


def asked(loaded: Loaded) -> list[Pose]:
    return [
        Pose(theta_i, dphi, theta_r)
        for sweep in loaded.protocol.sweeps
        for theta_i, dphi, theta_r in product(*(sweep[f"{name}_deg"] for name in AXES))
    ]


def visible(pose: Pose, loaded: Loaded) -> bool:
    apart_deg = camera_to_lamp_deg(pose.theta_i, pose.theta_r, pose.dphi)
    return bool(apart_deg >= min_separation_deg(loaded.rig))


def every_visible_geometry_is_a_point_once(plan: Plan, loaded: Loaded) -> None:
    points = Counter(step.pose for step in plan.points)
    assert points == Counter(pose for pose in asked(loaded) if visible(pose, loaded))
    assert Counter(plan.hidden) == Counter(p for p in asked(loaded) if not visible(p, loaded))
    assert set(points.values()) == {1}
    assert [step.index for step in plan.steps] == list(range(len(plan.steps)))
    assert all(visible(step.pose, loaded) for step in plan.steps)


def the_references_are_as_promised(plan: Plan, loaded: Loaded) -> None:
    tile, drift = loaded.protocol.references.white_tile, loaded.protocol.references.drift_check
    tiles = [step for step in plan.steps if step.kind == "tile"]
    settings_ = {step.lamp_setting: step.pose[:2] for step in plan.points}
    if tile is None:
        assert not tiles
    else:  # one reading of the tile for every place of the lamp, in the same setting by hand
        assert Counter(step.lamp_setting for step in tiles) == Counter(list(settings_))
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
    """Followed from home, one axis at a time: within limits, past no zone, to where it should."""
    pose = home_pose(rig)
    for step in plan.steps:
        pose = follow(pose, step.moves, rig)
        assert pose == step.pose


def follow(pose: Pose, moves: Sequence[Move], rig: Rig) -> Pose:
    """Where the moves lead from a pose; on the way each is within limits and in no zone."""
    for move in moves:
        axis = rig.axes[move.axis]
        assert axis.min_deg - 1e-9 <= move.angle_deg <= axis.max_deg + 1e-9
        for there in way(pose, move):
            assert not any(inside(zone, there) for zone in rig.keep_out)
        pose = pose._replace(**{move.axis: move.angle_deg})
    return pose


def way(pose: Pose, move: Move) -> list[Pose]:
    """Places from one end of a move to the other; a hand comes from where nobody knows."""
    start_deg = getattr(pose, move.axis)
    if math.isnan(start_deg):
        return [pose._replace(**{move.axis: move.angle_deg})]
    return [
        pose._replace(**{move.axis: float(angle_deg)})
        for angle_deg in np.linspace(start_deg, move.angle_deg, SAMPLES)
    ]


def inside(zone: KeepOut, pose: Pose) -> bool:
    """Whether a zone forbids a pose; where an axis stands nobody knows where, none does."""
    if zone.camera_to_lamp_deg is not None:
        apart_deg = float(camera_to_lamp_deg(pose.theta_i, pose.theta_r, pose.dphi))
        return apart_deg < zone.camera_to_lamp_deg - 1e-9
    limits = {name: getattr(zone, f"{name}_deg") for name in AXES}
    return all(
        pair is None or pair[0] <= getattr(pose, name) <= pair[1] for name, pair in limits.items()
    )
