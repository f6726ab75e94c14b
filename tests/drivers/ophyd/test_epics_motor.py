"""The EPICS motor of ophyd-async, in its mock mode, is an axis: position, limits, stop, unit.

This holds the class to the axis: which of its signals are read and written, and when. It does not
show a transport (Channel Access, PV Access) or a record that behaves otherwise than its manual.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import closing
from typing import TYPE_CHECKING

import pytest

from drivers.factory import open_ophyd
from drivers.stages.motor_stage import MotorStage
from instrument.clock import SystemClock
from instrument.config.axes import OphydAxis
from instrument.errors import DeviceError
from tests.support.facility.stopped_move import stopped_position_deg

pytest.importorskip("ophyd_async", reason="ophyd-async is not installed")
from ophyd_async.core import get_mock_put, set_mock_value

if TYPE_CHECKING:
    from tests.support.facility.epics_motors import MockedMotor

MOTORS = "tests.support.facility.epics_motors"
PREFIX = "BL07-MO-ROT-01:THETA"


def opened(motor: str = "MockedMotor", speed: float = 400.0) -> MotorStage:
    axis = OphydAxis(
        driver="ophyd", motor=f"{MOTORS}:{motor}", prefix=PREFIX, min_deg=-80.0, max_deg=80.0,
        u_deg=0.01, settle_s=0.0, speed_deg_per_s=speed, acceleration_deg_per_s2=100 * speed,
    )  # fmt: skip
    return open_ophyd("theta_r", axis, SystemClock())


def record() -> MockedMotor:
    """The motor of the stage that was opened last."""
    from tests.support.facility.epics_motors import MockedMotor

    return MockedMotor.last


@pytest.fixture
def stage() -> Iterator[MotorStage]:
    with closing(opened()) as own:
        yield own


def test_the_position_is_the_readback_of_the_record(stage: MotorStage) -> None:
    rng = random.Random(24)
    for _ in range(3):
        at_deg = rng.uniform(-50.0, 50.0)
        set_mock_value(record().user_readback, at_deg)
        assert stage.position_deg() == at_deg
    assert stage.identity() == f"ophyd-async motor {MOTORS}:MockedMotor at {PREFIX}"


def test_moves_end_where_they_were_sent_at_the_speed_of_the_rig_file(stage: MotorStage) -> None:
    rng = random.Random(25)
    stage.home()
    for _ in range(3):
        angle_deg = rng.uniform(-45.0, 45.0)
        stage.start_move(angle_deg)
        assert stage.wait() == pytest.approx(angle_deg, abs=1e-9)
    assert [call.args[0] for call in get_mock_put(record().velocity).call_args_list] == [400.0]
    assert record().stops == 0


def test_limits_of_the_rig_file_and_of_the_record_hold(stage: MotorStage) -> None:
    stage.home()
    with pytest.raises(DeviceError, match=r"85 deg asked for; its limits are -80 to 80 deg"):
        stage.start_move(85.0)
    stage.start_move(60.0)
    with pytest.raises(DeviceError, match=r"its move failed: .* limits are -50\.0deg <= x <= 50"):
        stage.wait()
    assert stage.status().position_deg == 0.0
    stage.start_move(1.0)  # a refused move is no lasting fault
    assert stage.wait() == pytest.approx(1.0)


def test_a_stop_from_another_thread_reaches_the_record_in_the_midst_of_a_move() -> None:
    with closing(opened(speed=20.0)) as stage:
        stage.home()
        at_deg = stopped_position_deg(stage, 45.0)
        assert record().stops >= 1
        assert at_deg < 30.0
        stage.start_move(at_deg + 0.5)
        assert stage.wait() == pytest.approx(at_deg + 0.5)


def test_a_stop_before_the_record_moves_is_sent_again_once_it_does() -> None:
    """The class leaves out STOP where DMOV is 1, and a record may say so after a move was sent."""
    with closing(opened("LateMotor", speed=20.0)) as stage:
        stage.home()
        stage.start_move(45.0)
        stage.stop()
        assert record().stops >= 1
        assert stage.position_deg() < 30.0


def test_a_motor_that_does_not_count_in_degrees_is_refused() -> None:
    with pytest.raises(DeviceError, match="counts in 'mm'; allowed: a motor that counts in deg"):
        opened("LinearMotor")
