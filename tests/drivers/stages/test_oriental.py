"""AZ drive's driver over RTU and TCP: moves, stops, alarms, and refusal of other devices."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sim.emulated.oriental_controller
from drivers.lines.modbus_bus import ModbusBus
from drivers.lines.modbus_client import BusSettings
from drivers.lines.serial_line import NoReply
from drivers.stages.motor_stage import Stopped
from drivers.stages.oriental import OrientalStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError, InputError
from sim.emulated.motor import Motor
from sim.emulated.oriental_controller import OrientalController, crc
from sim.emulated.wire import Fault, PtyWire
from tests.support.stages.emulated_az_drive import (
    FAST,
    LIMITS,
    SLOW,
    SLOW_LIMITS,
    STEPS_PER_DEG,
    WIRES,
    EmulatedDrive,
    emulated_drive,
)
from tests.support.stages.kinds import AzStage
from tests.support.stages.modbus_tcp_gateway import ModbusTcpGateway, TcpWire
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

STOP_TCP, STOP_RTU = bytes.fromhex("06 007D 0020"), bytes.fromhex("01 06 007D 0020")
MOVE_WRITE = bytes.fromhex("10 0058 0010 20")


@pytest.fixture(params=WIRES)
def az(request: pytest.FixtureRequest) -> Iterator[EmulatedDrive]:
    with emulated_drive(request.param, reply_s=0.1) as made:
        yield made


@pytest.fixture(params=WIRES)
def slow_az(request: pytest.FixtureRequest) -> Iterator[EmulatedDrive]:
    with emulated_drive(request.param, SLOW, SLOW_LIMITS) as made:
        yield made


def test_identity(az: EmulatedDrive) -> None:
    stage = az.open()
    assert stage.identity() == "Oriental Motor AZ drive, by its registers, unit 1"


def test_homing_moves_and_positions(az: EmulatedDrive) -> None:
    stage = az.homed()
    assert az.drive.homings == 1
    for count, angle in enumerate((12.34, -56.78, 169.994, 0.0), start=1):
        stage.start_move(angle)
        arrived = stage.wait()
        assert arrived == pytest.approx(angle, abs=0.5 / STEPS_PER_DEG + 1e-9)
        assert arrived == pytest.approx(az.motor.position_deg, abs=0.5 / STEPS_PER_DEG)
        assert az.drive.triggers == count
    stage.start_move(0.0)  # where it is
    assert stage.wait() == 0.0


def test_nothing_is_sent_for_a_move_past_a_limit(az: EmulatedDrive) -> None:
    stage = az.homed()
    seen = list(az.wire.seen)
    for angle in (170.01, -170.01, float("nan")):
        with pytest.raises(DeviceError, match="its limits are -170 to 170 deg"):
            stage.start_move(angle)
    assert az.wire.seen == seen


def test_nothing_moves_before_homing(az: EmulatedDrive) -> None:
    stage = az.open()
    with pytest.raises(DeviceError, match="not homed"):
        stage.start_move(1.0)
    assert not az.sent(MOVE_WRITE)


def test_the_position_is_the_feedback_and_not_the_command(slow_az: EmulatedDrive) -> None:
    stage = slow_az.homed()
    stage.start_move(90.0)
    assert stage.position_deg() < 45.0
    assert stage.position_deg() == pytest.approx(slow_az.motor.position_deg, abs=1.0)


def test_a_stop_from_another_thread_ends_the_wait_and_can_be_repeated(
    slow_az: EmulatedDrive,
) -> None:
    stage, ended = slow_az.homed(), []
    stage.start_move(90.0)

    def wait() -> None:
        with pytest.raises(Stopped) as stopped:
            stage.wait()
        ended.append(stopped.value)

    waiting = threading.Thread(target=wait)
    waiting.start()
    since, before_s = len(slow_az.wire.seen), time.monotonic()
    stage.stop()
    assert slow_az.sent(STOP_TCP, since)[0] - before_s < 2 * slow_az.reply_s
    stage.stop()
    waiting.join(timeout=5)
    assert len(ended) == 1
    assert not slow_az.motor.moving
    stage.start_move(stage.position_deg() + 0.1)  # the STOP bit is taken back
    stage.wait()
    assert slow_az.drive.triggers == 2


def test_a_stop_waits_for_one_lost_answer_at_most(slow_az: EmulatedDrive) -> None:
    stage = slow_az.homed()
    stage.start_move(90.0)
    since = len(slow_az.wire.seen)
    slow_az.wire.inject(Fault("drop"), Fault("drop"))
    reading = threading.Thread(target=stage.position_deg)
    reading.start()
    wait_until(lambda: len(slow_az.wire.seen) > since)
    before_s = time.monotonic()
    stage.stop()  # its own first answer is dropped too
    assert slow_az.sent(STOP_TCP, since)[0] - before_s < 2 * slow_az.reply_s
    assert len(slow_az.sent(STOP_TCP, since)) == 2
    assert not slow_az.motor.moving
    reading.join(timeout=5)


def test_a_stop_does_not_wait_until_the_line_is_quiet(slow_az: EmulatedDrive) -> None:
    stage = slow_az.homed()
    stage.start_move(90.0)
    slow_az.wire.inject(Fault("drop"))
    reading = threading.Thread(target=stage.position_deg)
    begun_s = time.monotonic()
    reading.start()
    wait_until(lambda: time.monotonic() - begun_s > 0.3)  # past the time-out: it listens for quiet
    since, before_s = len(slow_az.wire.seen), time.monotonic()
    stage.stop()
    assert slow_az.sent(STOP_TCP, since)[0] - before_s < 0.1
    reading.join(timeout=5)


def test_a_stop_left_in_the_drive_is_cleared_before_the_first_motion(az: EmulatedDrive) -> None:
    az.drive.serve(STOP_TCP)
    stage = az.homed()
    stage.start_move(1.0)
    assert stage.wait() == 1.0


def test_an_alarm_ends_the_wait_and_forbids_moves(slow_az: EmulatedDrive) -> None:
    stage = slow_az.homed()
    stage.start_move(90.0)
    slow_az.motor.fail("66")
    with pytest.raises(DeviceError, match=r"theta_r: alarm 66h \(hardware overtravel\)"):
        stage.wait()
    since = len(slow_az.wire.seen)
    for motion in (lambda: stage.start_move(1.0), stage.home):
        with pytest.raises(DeviceError, match="alarm 66h"):
            motion()
    assert not slow_az.sent(MOVE_WRITE, since)
    assert (slow_az.drive.triggers, slow_az.drive.homings) == (1, 1)


def test_a_target_beyond_the_drives_own_limits_raises_its_alarm() -> None:
    with emulated_drive("pty", replace(FAST, max_deg=90.0)) as az:
        stage = az.homed()
        stage.start_move(100.0)
        with pytest.raises(DeviceError, match="alarm 67h"):
            stage.wait()
        assert az.motor.position_deg == 0.0


def test_a_blocked_stage_is_reported_as_stalled() -> None:
    with emulated_drive("pty", SLOW, SLOW_LIMITS) as az:
        stage = az.homed()
        stage.start_move(30.0)
        wait_until(lambda: az.motor.position_deg > 0.5)
        az.motor.hold()
        with pytest.raises(DeviceError, match="stalled"):
            stage.wait()
        assert not az.motor.moving


def test_a_blocked_motor_raises_the_drives_overload_alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sim.emulated.oriental_controller, "OVERLOAD_S", 0.2)
    with emulated_drive("pty", SLOW, SLOW_LIMITS) as az:
        stage = az.homed()
        stage.start_move(30.0)
        az.motor.hold()
        with pytest.raises(DeviceError, match=r"alarm 30h \(overload\)"):
            stage.wait()


def test_homing_without_a_reference_ends_with_an_error_and_a_stop() -> None:
    with emulated_drive("pty", FAST, replace(LIMITS, homing_s=0.2)) as az:
        az.motor.homing_fails = True
        stage = az.open()
        with pytest.raises(DeviceError, match=r"not found within 0.2 s"):
            stage.home()
        assert az.sent(STOP_RTU)
        assert not az.motor.homing


def test_no_move_is_sent_to_a_drive_that_is_not_ready(az: EmulatedDrive) -> None:
    stage = az.homed()
    az.drive.serve(bytes.fromhex("06 007D 0040"))  # FREE: the motor is without current
    with pytest.raises(DeviceError, match=r"not ready to move .* STOP and FREE"):
        stage.start_move(1.0)
    assert az.drive.triggers == 0


def test_a_moving_stage_refuses_commands(az: EmulatedDrive) -> None:
    stage = az.homed()
    az.motor.move(170.0)
    az.motor.hold()
    for command in (lambda: stage.start_move(1.0), stage.home):
        with pytest.raises(DeviceError, match=r"is moving already, .* or stop it first"):
            command()
    assert az.drive.triggers == 0
    assert az.motor.moving


@pytest.mark.parametrize("kind", WIRES)
def test_several_drives_share_one_line(kind: str) -> None:
    drives = [OrientalController(Motor(FAST, SystemClock()), unit, 100.0) for unit in (1, 2)]
    with PtyWire(drives) if kind == "pty" else TcpWire([ModbusTcpGateway(drives)]) as wire:
        port = wire.port if isinstance(wire, PtyWire) else f"tcp://localhost:{wire.port}"
        clock = SystemClock()
        with ModbusBus("line", BusSettings(port, parity="N"), clock) as bus:
            stages = [OrientalStage(f"axis {u}", bus, u, 100.0, LIMITS, clock) for u in (1, 2)]
            for stage in stages:
                stage.home()
            wire.inject(Fault("late", 0.16))
            stages[0].start_move(30.0)
            stages[1].start_move(-20.0)
            assert [stage.wait() for stage in stages] == [30.0, -20.0]
            stages[0].close()
            assert stages[1].position_deg() == -20.0  # the line is the bus's, not the stage's
    assert [drive.triggers for drive in drives] == [1, 1]


class Parrot:
    """Gives the same answer to every request."""

    def __init__(self, answer: str, check: bool = True) -> None:
        data = bytes.fromhex(answer)
        self._answer = data + crc(data) if check and data else data

    def answer(self, _data: bytes) -> bytes:
        return self._answer


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        ("01 83 02", r"register 00(58|7E) hex at .*: exception 02 \(illegal data address\)"),
        ("01 83 63", r"exception 63 \(not known here\)"),
        ("01 83 0B", "the device behind the gateway did not answer"),
        ("", "no answer within 0.1 s"),
        ("02 03 04 00000000", "no whole answer"),  # another unit's
        ("01 10 0058 0010", "an answer to function 16"),
        ("01 03 04 00000000", "2 registers instead of"),
        ("01 03 05 0000000000", "no whole answer|registers instead of"),
        ("01 7F 00 00", "no whole answer|an answer to function"),
    ],
)
def test_a_device_that_does_not_answer_like_a_drive_is_refused(answer: str, says: str) -> None:
    with PtyWire([Parrot(answer)]) as wire, pytest.raises(DeviceError, match=says):
        AzStage(BusSettings(wire.port, parity="N", reply_s=0.1), LIMITS)


@settings(max_examples=15)
@given(st.binary(min_size=1, max_size=40))
def test_noise_instead_of_an_answer_is_a_device_error(noise: bytes) -> None:
    with PtyWire([Parrot(noise.hex(), check=False)]) as wire, pytest.raises(DeviceError):
        AzStage(BusSettings(wire.port, parity="N", reply_s=0.004), LIMITS)


def test_a_device_with_values_out_of_range_is_refused() -> None:
    with emulated_drive("pty") as az:
        az.drive.serve(bytes.fromhex("10 0058 0002 04 0000 03E7"))
        with pytest.raises(DeviceError, match="is no Oriental Motor AZ drive: data number 999"):
            az.open()


def test_silence_is_an_error_within_two_seconds(az: EmulatedDrive) -> None:
    begun_s = time.monotonic()
    with pytest.raises(NoReply, match=r"no answer|did not answer"):
        az.open(unit=7)
    assert time.monotonic() - begun_s < 2.0


def test_a_move_costs_few_requests_and_little_time(az: EmulatedDrive) -> None:
    stage, spent = az.homed(), []
    for _ in range(9):
        since, begun_s = len(az.wire.seen), time.monotonic()
        stage.start_move(0.0)
        assert stage.wait() == 0.0
        spent.append(time.monotonic() - begun_s)
        assert len(az.wire.seen) - since <= 6
    assert min(spent) < 0.04


def test_a_tolerance_of_less_than_half_a_step_is_refused() -> None:
    with PtyWire([]) as wire, pytest.raises(InputError, match=r"tolerance_deg: 0.001 deg: less"):
        AzStage(BusSettings(wire.port, parity="N"), replace(LIMITS, tolerance_deg=0.001))
