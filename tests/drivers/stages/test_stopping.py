"""Stop of a stage: read back, repeated if it was lost on the wire, reported if it has no effect.

In simulated time over controllers in memory, so that each byte of each stop can be lost.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import pytest

from drivers.lines.serial_line import NoReply
from drivers.stages.motion import STALLED_S, Status
from drivers.stages.motor_stage import MotorStage, Stopped
from drivers.stages.stopping import CHECK_S, STANDS_S, StopMonitor
from instrument.errors import DeviceError
from tests.support.stages.kinds import KINDS
from tests.support.stages.memory_stages import LIMITS, MECHANICS, MemoryStage, in_memory

SERIAL = ("newport", "zaber", "oriental rtu")
SPEED, RAMP = 20.0, 40.0
BRAKES_S = SPEED / RAMP
PROMISED_S = 0.5 + BRAKES_S
SPOILT: dict[str, Callable[[bytes, int], bytes]] = {
    "lost": lambda data, at: data[:at] + data[at + 1 :],
    "garbled": lambda data, at: data[:at] + bytes([data[at] ^ 0x15]) + data[at + 1 :],
}


def slow_stage(
    kind: str, patch: pytest.MonkeyPatch, ramp: float = RAMP
) -> tuple[MemoryStage, MotorStage]:
    mechanics = replace(
        MECHANICS, speed_deg_per_s=SPEED, acceleration_deg_per_s2=ramp, homing_s=0.01
    )
    limits = replace(LIMITS, speed_deg_per_s=SPEED, acceleration_deg_per_s2=ramp)
    found = in_memory(kind, patch, mechanics, limits)
    stage = found.open()
    stage.home()
    return found, stage


def under_way(found: MemoryStage, stage: MotorStage, motion: str) -> None:
    """Set the stage going at full speed, or searching for its reference."""
    found.clock.readings = 0
    if motion == "homing":
        found.motor.mechanics = replace(found.motor.mechanics, homing_s=10.0)
        found.motor.home()
        found.clock.sleep(0.5)
        return
    stage.start_move(-80.0)
    found.clock.sleep(1.0)


def next_stop(found: MemoryStage, change: Callable[[bytes], bytes]) -> list[bytes]:
    """Change the next stop on its way; return the list of stops sent from now on."""
    stop, stops = KINDS[found.kind].stop, []

    def spoilt(data: bytes) -> bytes:
        if stop not in data:
            return data
        stops.append(data)
        return change(data) if len(stops) == 1 else data

    found.wire.spoil_request = spoilt
    return stops


def still_moves(found: MemoryStage) -> bool:
    here_deg = found.motor.position_deg
    found.clock.sleep(0.01)
    return found.motor.moving or found.motor.position_deg != here_deg


@pytest.mark.parametrize("fault", SPOILT)
@pytest.mark.parametrize("motion", ["moving", "homing"])
@pytest.mark.parametrize("kind", SERIAL)
def test_a_stop_that_is_spoilt_on_the_wire_is_sent_again(
    kind: str, motion: str, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each byte in turn; after it, the stage goes on as if nothing had happened."""
    found, stage = slow_stage(kind, monkeypatch)
    under_way(found, stage, motion)
    stage.stop()
    length = len(next(data for data in found.wire.sent if KINDS[kind].stop in data))
    for at in range(length):
        found.motor.mechanics = replace(found.motor.mechanics, homing_s=0.01)
        found.clock.readings = 0
        stage.home()
        under_way(found, stage, motion)
        stops = next_stop(found, lambda data, at=at: SPOILT[fault](data, at))
        begun_s = found.clock.now_s()
        stage.stop()
        assert not still_moves(found), at
        assert len(stops) <= 3, at
        assert found.clock.now_s() - begun_s < PROMISED_S + STANDS_S + 0.02, at


@pytest.mark.parametrize("motion", ["moving", "homing"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_whose_request_or_answers_are_lost_is_confirmed_all_the_same(
    kind: str, motion: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for lost in (1, 2, 3):
        found, stage = slow_stage(kind, monkeypatch)
        under_way(found, stage, motion)
        stops = next_stop(found, lambda _: b"")
        stage.stop()
        assert not still_moves(found)
        assert len(stops) >= 2
        found, stage = slow_stage(kind, monkeypatch)
        under_way(found, stage, motion)
        answers = [b""] * lost
        found.wire.spoil = lambda answer, left=answers: left.pop() if left else answer
        stage.stop()
        assert not still_moves(found)
        assert not answers


@pytest.mark.parametrize("kind", KINDS)
def test_a_stage_that_brakes_slowly_is_told_to_stop_once(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, stage = slow_stage(kind, monkeypatch, ramp=8.0)  # brakes for 2.5 s
    stage.start_move(80.0)
    found.clock.sleep(3.5)
    stops, begun_s = next_stop(found, lambda data: data), found.clock.now_s()
    stage.stop()
    assert len(stops) == 1
    assert found.clock.now_s() - begun_s == pytest.approx(SPEED / 8.0, abs=0.4)  # whole data units
    assert not still_moves(found)


@pytest.mark.parametrize("kind", KINDS)
def test_a_controller_that_obeys_no_stop_is_told_its_harder_one_or_reported(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, stage = slow_stage(kind, monkeypatch)
    under_way(found, stage, "moving")
    monkeypatch.setattr(found.motor, "stop", lambda: None)
    begun_s = found.clock.now_s()
    if kind == "zaber":
        stage.stop()
        assert any(b"estop" in data for data in found.wire.sent)
        assert not still_moves(found)
    else:
        with pytest.raises(
            DeviceError, match=r"theta_r: may still move: not at rest .* 1\.\d s .*power"
        ):
            stage.stop()
    assert found.clock.now_s() - begun_s < BRAKES_S + 1.5 * STALLED_S


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_that_cannot_be_read_back_is_an_error_in_a_bounded_time(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, stage = slow_stage(kind, monkeypatch)
    under_way(found, stage, "moving")
    found.wire.spoil = lambda _: b""
    begun_s = found.clock.now_s()
    with pytest.raises(NoReply, match=r"theta_r: .* not read to stand after .* it may still move"):
        stage.stop()
    assert found.clock.now_s() - begun_s < BRAKES_S + 2 * STALLED_S
    assert not still_moves(found)  # it was told, all the same


@pytest.mark.parametrize("kind", KINDS)
def test_a_pause_of_the_computer_in_a_stop_does_not_make_it_fail(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, stage = slow_stage(kind, monkeypatch)
    under_way(found, stage, "moving")
    stage.begin_stop()
    found.clock.sleep(5.0)
    stage.finish_stop()
    assert not still_moves(found)


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_before_the_move_command_leaves_is_repeated_and_read_back(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other thread has read the stage to stand, before the command; then a stop is lost."""
    found, stage = slow_stage(kind, monkeypatch)
    send = stage._send_move

    def stopped_meanwhile(angle_deg: float) -> None:
        stage.stop()
        stage._stopped = False  # seen too late by the driver
        send(angle_deg)
        stage._stopped = True
        next_stop(found, lambda _: b"")

    monkeypatch.setattr(stage, "_send_move", stopped_meanwhile)
    with pytest.raises(Stopped):
        stage.start_move(80.0)
    assert not still_moves(found)
    assert abs(found.motor.position_deg) < 20.0


@pytest.mark.parametrize("kind", KINDS)
def test_a_stop_while_the_status_before_a_move_is_read_keeps_it_from_being_sent(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, stage = slow_stage(kind, monkeypatch)
    status, begun = stage.status, found.moves()

    def stopped_meanwhile(retry: bool = True) -> Status:
        monkeypatch.setattr(stage, "status", status)
        stage.begin_stop()
        return status(retry)

    monkeypatch.setattr(stage, "status", stopped_meanwhile)
    with pytest.raises(Stopped, match="theta_r: stopped before it was told to move"):
        stage.start_move(80.0)
    stage.finish_stop()
    assert found.moves() == begun
    stage.start_move(5.0)  # and may be told to move anew
    assert stage.wait() == pytest.approx(5.0, abs=0.01)


def test_an_error_that_a_spoilt_stop_has_left_refuses_no_later_move(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found, stage = slow_stage("newport", monkeypatch)
    under_way(found, stage, "moving")
    next_stop(found, lambda data: data.replace(b"S", b"X"))
    stage.stop()
    here_deg = stage.position_deg()
    stage.start_move(here_deg + 1.0)
    assert stage.wait() == pytest.approx(here_deg + 1.0, abs=0.01)


@pytest.mark.parametrize("kind", ["newport", "zaber"])
def test_a_move_whose_command_was_lost_is_sent_again_however_late_it_is_waited_for(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The program reduces frames meanwhile, and waits for a slow disk."""
    found, stage = slow_stage(kind, monkeypatch)
    word = {"newport": b"PA", "zaber": b"move"}[kind]
    lost = [b""]
    found.wire.spoil_request = lambda data: lost.pop() if word in data and lost else data
    stage.start_move(5.0)
    found.clock.sleep(8.0)
    assert stage.wait() == pytest.approx(5.0, abs=0.01)
    assert found.moves() == 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", SERIAL)
def test_a_stop_that_returns_has_ended_the_motion_whatever_the_line_does(
    kind: str, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Requests and answers are lost, cut and spoilt, by a share that differs from stop to stop."""
    rng = random.Random(16)
    number = 1000 if slow else 12
    reports: list[str] = []
    for _ in range(number):
        found, stage = slow_stage(kind, monkeypatch, ramp=rng.choice([8.0, 40.0, 400.0]))
        under_way(found, stage, rng.choice(["moving", "homing"]))
        share = rng.choice([0.0, 0.1, 0.2, 0.4, 0.8])
        found.wire.spoil_request = partial(_spoilt, rng, share)
        found.wire.spoil = partial(_spoilt, rng, share)
        try:
            stage.stop()
        except DeviceError as error:
            reports.append(str(error))
        else:
            assert not still_moves(found)
    assert all("may still move" in report for report in reports)
    assert 0 < len(reports) < number


def _spoilt(rng: random.Random, share: float, data: bytes) -> bytes:
    if rng.random() >= share:
        return data
    cut = rng.randrange(len(data))
    return rng.choice(
        [b"", data[:cut], data[:cut] + data[cut + 1 :], bytes(0x80 | b for b in data)]
    )


def test_rest_is_believed_only_once_a_move_can_no_longer_begin() -> None:
    """Some controllers still report ready just after the command."""
    rest, moving = Status(0.0, moving=False, homed=True), Status(0.0, moving=True, homed=True)
    monitor = StopMonitor(LIMITS, begun_s=0.0, rest_from_s=0.5)
    said = [monitor.stands(rest, s, s) for s in (0.0, 0.1, 0.4, 0.5)]
    assert said == [False, False, False, True]
    seen = StopMonitor(LIMITS, begun_s=0.0, rest_from_s=0.5)
    assert [seen.stands(now, s, s) for now, s in ((moving, 0.0), (rest, 0.1))] == [False, False]
    assert seen.stands(rest, 0.1 + STANDS_S, 0.1 + STANDS_S)


def test_rest_is_measured_from_the_end_of_an_answer_that_came_late() -> None:
    """The state may be that of a stage without reference, which still brakes."""
    monitor = StopMonitor(LIMITS, begun_s=0.0, rest_from_s=0.0)
    assert not monitor.stands(Status(1.0, moving=False, homed=False), 0.0, 0.1)
    assert not monitor.stands(Status(1.001, moving=False, homed=False), 0.1, 0.101)
    assert monitor.stands(Status(1.001, moving=False, homed=False), 0.16, 0.17)


def test_rest_at_changing_places_is_no_rest() -> None:
    monitor = StopMonitor(LIMITS, begun_s=0.0, rest_from_s=0.0)
    for number in range(20):
        turned, time_s = Status(number * 1.0, moving=False, homed=True), number * STANDS_S
        assert not monitor.stands(turned, time_s, time_s)


def test_a_constant_speed_is_no_braking_whatever_the_speed() -> None:
    for speed in (0.0, 0.3, 20.0, 500.0):
        monitor = StopMonitor(LIMITS, begun_s=0.0, rest_from_s=0.0)
        statuses = [Status(speed * n * CHECK_S, moving=True, homed=False) for n in range(4)]
        said = [monitor.should_resend(s, n * CHECK_S * 1.001) for n, s in enumerate(statuses)]
        assert said == [False, False, True, True]
