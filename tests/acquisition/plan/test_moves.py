"""Moves: one axis after the other, backlash taken up, clear of all keep-out zones."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.plan.moves import SAME_ANGLE_DEG, NoPathError, moves_between
from acquisition.plan.pose import Pose
from instrument.config.load import Loaded
from instrument.config.rig import KeepOut, Rig
from instrument.errors import InputError
from tests.support.random_plans import ZONES, base, follow


def _with_zone(rig: Rig, **zone: object) -> Rig:
    return rig.model_copy(update={"keep_out": [KeepOut(name="zone", **zone)]})  # type: ignore[arg-type]  # a test's shorthand


def test_angles_are_approached_from_below(demo: Loaded) -> None:
    down = moves_between(Pose(30, 0, 40), Pose(30, 0, 20), demo.rig)
    assert [(m.axis, m.angle_deg) for m in down] == [("theta_r", 19.5), ("theta_r", 20)]
    up = moves_between(Pose(30, 0, 20), Pose(30, 0, 40), demo.rig)
    assert [(m.axis, m.angle_deg) for m in up] == [("theta_r", 40)]


def test_the_beam_does_not_cross_the_lamp(demo: Loaded) -> None:
    lamp = _with_zone(demo.rig, camera_to_lamp_deg=2.0)
    start, end = Pose(45, 0, 30), Pose(45, 0, 60)
    with pytest.raises(InputError, match="keep-out zone"):
        moves_between(start, end, lamp)
    # Out of the lamp's plane the same swing is clear.
    assert moves_between(start._replace(dphi=30), end._replace(dphi=30), lamp)


def test_another_order_of_the_axes_is_taken_if_it_is_clear(demo: Loaded) -> None:
    # theta_i first would cross the camera at 40; theta_r first is clear.
    lamp = _with_zone(demo.rig, camera_to_lamp_deg=2.0)
    moves = moves_between(Pose(30, 0, 40), Pose(60, 0, 70), lamp)
    assert [m.axis for m in moves] == ["theta_r", "theta_i"]


def test_an_axis_without_room_for_its_backlash_is_named(demo: Loaded) -> None:
    with pytest.raises(InputError, match=r"theta_r would go to -88.2 deg .* limits are -88 to 88"):
        moves_between(Pose(30, 0, 0), Pose(30, 0, -87.7), demo.rig)


def test_the_path_of_a_hand_set_axis_is_checked_too() -> None:
    lamp = _with_zone(base("paper_1995").rig, camera_to_lamp_deg=8.0)
    with pytest.raises(InputError, match="theta_i from 30 to 70 deg meets the keep-out zone"):
        moves_between(Pose(30, 0, 60), Pose(70, 0, 60), lamp)
    # The camera moves first if that clears the path.
    moves = moves_between(Pose(30, 0, 60), Pose(70, 0, 80), lamp)
    assert [m.axis for m in moves] == ["theta_r", "theta_i"]


POSES = st.builds(
    Pose, st.floats(1.0, 84.0), st.floats(1.0, 180.0), st.floats(-87.0, 87.0)
)  # each with room for the backlash below it


@pytest.mark.slow
def test_any_moves_are_clear_whatever_the_order_of_their_axes(slow: bool) -> None:
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
