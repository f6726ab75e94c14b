"""Duration of a move: the first long one shows whether the controller does the speed it was set."""

from __future__ import annotations

from dataclasses import replace

import pytest

from instrument.errors import DeviceError
from instrument.kinematics import Trapezoid
from tests.support.stages.kinds import SERIAL
from tests.support.stages.memory_stages import LIMITS, MECHANICS, MemoryStage, in_memory

ANGLES_DEG = {(20.0, 40.0): 15.0, (5.0, 400.0): 6.0, (100.0, 15.0): 7.0}  # each about 1.3 s
ANGLE_DEG = ANGLES_DEG[20.0, 40.0]


def memory(
    kind: str, patch: pytest.MonkeyPatch, asked: tuple[float, float], done: tuple[float, float]
) -> MemoryStage:
    """A stage told one speed and acceleration, whose controller does another, whatever it reads."""
    speed, ramp = done
    mechanics = replace(MECHANICS, speed_deg_per_s=speed, acceleration_deg_per_s2=ramp)
    limits = replace(LIMITS, speed_deg_per_s=asked[0], acceleration_deg_per_s2=asked[1])
    found = in_memory(kind, patch, mechanics, limits)
    if done != asked:
        patch.setattr(found.motor, "set_speed", lambda *_: None)
    return found


@pytest.mark.parametrize("kind", SERIAL)
@pytest.mark.parametrize(
    ("asked", "factor", "says"),
    [
        ((20.0, 40.0), 1.0, ""),
        ((5.0, 400.0), 1.0, ""),
        ((100.0, 15.0), 1.0, ""),
        ((20.0, 40.0), 2.0, "too fast"),
        ((5.0, 400.0), 1.2, "too fast"),
        ((100.0, 15.0), 1.5, "too fast"),
        ((20.0, 40.0), 0.4, "too slow"),
        ((5.0, 400.0), 0.5, "too slow"),
    ],
)
def test_a_speed_that_is_not_done_is_told_by_the_motions_duration(
    kind: str,
    asked: tuple[float, float],
    factor: float,
    says: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    done = (asked[0] * factor, asked[1] * factor)
    found = memory(kind, monkeypatch, asked, done)
    stage = found.open()
    stage.home()
    found.clock.readings = 0
    angle_deg = ANGLES_DEG[asked]
    stage.start_move(angle_deg)
    if not says:
        assert stage.wait() == pytest.approx(angle_deg, abs=0.01)
        return
    with pytest.raises(DeviceError, match=rf"theta_r: moved from 0 to .* deg in .* s, {says}: it"):
        stage.wait()


@pytest.mark.parametrize("kind", ["newport", "zaber"])
def test_the_emulated_controller_obeys_what_it_is_set_to(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A long move lasts as long as the speed and acceleration just set say."""
    asked = (20.0, 40.0)
    found = memory(kind, monkeypatch, asked, asked)
    found.motor.set_speed(500.0, 5000.0)  # as another program has left it
    stage = found.open()
    stage.home()
    found.clock.readings = 0
    begun_s = found.clock.now_s()
    stage.start_move(ANGLE_DEG)
    stage.wait()
    expected_s = Trapezoid(ANGLE_DEG, *asked).duration_s
    assert found.clock.now_s() - begun_s == pytest.approx(expected_s, rel=0.05)


def test_a_stage_that_is_waited_for_late_is_not_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    found = memory("newport", monkeypatch, (20.0, 40.0), (20.0, 40.0))
    stage = found.open()
    stage.home()
    found.clock.readings = 0
    stage.start_move(ANGLE_DEG)
    found.clock.sleep(60.0)  # the frames of the step before are reduced meanwhile
    assert stage.wait() == pytest.approx(ANGLE_DEG, abs=0.01)
