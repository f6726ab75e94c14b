"""Motor stages over every kind of emulated controller: moves, limits, stops, stalls, alarms."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager

import pytest

from drivers.stages.motion import Status
from drivers.stages.motor_stage import MotorStage, Stopped
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from tests.support.stages.emulated_stages import (
    EMULATED_STAGES,
    LIMITS,
    MECHANICS,
    SLOW,
    EmulatedStage,
)
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits


@pytest.fixture(params=list(EMULATED_STAGES))
def make(request: pytest.FixtureRequest) -> Callable[..., AbstractContextManager[EmulatedStage]]:
    return EMULATED_STAGES[request.param]


@pytest.fixture
def emulated(make: Callable[..., AbstractContextManager[EmulatedStage]]) -> Iterator[EmulatedStage]:
    with make(MECHANICS) as emulated:
        yield emulated


def test_identity_names_the_maker_and_not_the_port(emulated: EmulatedStage) -> None:
    assert emulated.kind.name in emulated.stage.identity()
    # The port is none of it: a plug may move to another.
    assert str(emulated.wire.port) not in emulated.stage.identity()


def test_nothing_moves_before_homing(emulated: EmulatedStage) -> None:
    with pytest.raises(DeviceError, match=r"theta_r.*not homed.*home it first"):
        emulated.stage.start_move(10.0)
    assert emulated.moves() == 0


def test_nothing_is_sent_for_a_move_past_the_narrower_limit(emulated: EmulatedStage) -> None:
    emulated.stage.home()
    assert emulated.stage.limits_deg() == pytest.approx((-90.0, emulated.max_deg), abs=1e-3)
    sent = len(emulated.wire.seen)
    for angle_deg in (emulated.max_deg + 0.001, 1e6, -90.001, float("nan"), float("inf")):
        with pytest.raises(DeviceError, match=r"theta_r: .* deg asked for; its limits are -90 to"):
            emulated.stage.start_move(angle_deg)
    assert len(emulated.wire.seen) == sent


def test_moves_end_at_their_targets(emulated: EmulatedStage) -> None:
    emulated.stage.home()
    assert emulated.stage.position_deg() == pytest.approx(0.0, abs=1e-3)
    for angle_deg in (10.0, -90.0, 79.9, 79.9, 79.901, 0.0):
        emulated.stage.start_move(angle_deg)
        assert emulated.stage.wait() == pytest.approx(angle_deg, abs=1e-3)
        assert emulated.motor.position_deg == pytest.approx(angle_deg, abs=1e-3)


def test_start_move_returns_at_once_and_wait_at_the_end(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as emulated:
        emulated.stage.home()
        begun_s = time.monotonic()
        emulated.stage.start_move(10.0)
        returned_s = time.monotonic() - begun_s
        assert 0 <= emulated.stage.position_deg() < 10.0
        assert emulated.stage.wait() == pytest.approx(10.0, abs=1e-3)
        assert returned_s < 0.5 * (time.monotonic() - begun_s)


def test_homing_twice_is_allowed(emulated: EmulatedStage) -> None:
    emulated.stage.home()
    emulated.stage.start_move(20.0)
    emulated.stage.wait()
    emulated.stage.home()
    assert emulated.stage.position_deg() == pytest.approx(0.0, abs=1e-3)


def test_a_stop_from_another_thread_ends_the_move(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(70.0)
        wait_until(lambda: emulated.motor.position_deg > 1.0)
        stopper = threading.Timer(0.05, emulated.stage.stop)
        stopper.start()
        with pytest.raises(Stopped, match=r"theta_r: stopped at [\d.]+ deg"):
            emulated.stage.wait()
        stopper.join()
        wait_until(lambda: not emulated.motor.moving)  # on the wire is not yet read
        assert 1.0 < emulated.motor.position_deg < 60.0
        emulated.stage.stop()
        emulated.stage.start_move(0.0)  # and it may be told to go on
        assert emulated.stage.wait() == pytest.approx(0.0, abs=1e-3)


def test_stopping_a_stage_at_rest_is_allowed(emulated: EmulatedStage) -> None:
    emulated.stage.stop()
    emulated.stage.home()
    emulated.stage.stop()
    emulated.stage.stop()
    emulated.stage.start_move(3.0)
    assert emulated.stage.wait() == pytest.approx(3.0, abs=1e-3)


def test_a_stop_is_sent_at_once(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(70.0)
        sent, asked_s = len(emulated.wire.seen), time.monotonic()
        emulated.stage.stop()
        wait_until(lambda: len(emulated.wire.seen) > sent)
        assert emulated.wire.seen[sent][0] - asked_s < 0.1
        wait_until(lambda: not emulated.motor.moving)


def test_a_blocked_stage_is_reported_as_stalled(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(40.0)
        wait_until(lambda: emulated.motor.position_deg > 1.0)
        emulated.motor.hold()
        with pytest.raises(DeviceError, match=r"stalled at .* on the way to 40 deg.*holds"):
            emulated.stage.wait()
        wait_until(lambda: not emulated.motor.moving)  # it was told to stop pushing


def test_an_alarm_is_reported_with_its_code_and_forbids_motion(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(40.0)
        emulated.motor.fail(emulated.kind.alarm)
        code = emulated.kind.alarm.lstrip("0")
        with pytest.raises(DeviceError, match=rf"theta_r: .*{code}.*look for what holds the stage"):
            emulated.stage.wait()
        moves = emulated.moves()
        with pytest.raises(DeviceError, match=code):
            emulated.stage.start_move(10.0)
        with pytest.raises(DeviceError, match=code):
            emulated.stage.home()
        assert emulated.moves() == moves


def test_homing_ends_with_an_error_if_the_reference_is_not_found(emulated: EmulatedStage) -> None:
    emulated.motor.homing_fails = True
    with pytest.raises(DeviceError, match=r"reference was not found within 3 s.*reference switch"):
        emulated.stage.home()
    wait_until(lambda: not emulated.motor.homing)


class _Braking(MotorStage):
    """Comes to rest a while after it was stopped, as what has mass does."""

    def __init__(self, asked_while_moving: int) -> None:
        super().__init__("theta_r", LIMITS, SimulatedClock())
        self._left = asked_while_moving

    def status(self, retry: bool = True) -> Status:  # noqa: ARG002 - a stage's form
        self._left -= 1
        return Status(5.0, moving=self._left >= 0, homed=True)

    def identity(self) -> str:
        raise NotImplementedError

    close = _send_home = _apply_speed = _send_stop = _own_limits_deg = identity  # type: ignore[assignment]  # not used

    def _send_move(self, angle_deg: float) -> None:
        raise NotImplementedError


def test_homed_waits_for_a_stopped_stage_to_come_to_rest() -> None:
    braking = _Braking(asked_while_moving=7)
    assert braking.homed()
    assert braking._left == -1
    with pytest.raises(DeviceError, match=r"theta_r: still moves .* cut its power"):
        _Braking(asked_while_moving=10_000).homed()
