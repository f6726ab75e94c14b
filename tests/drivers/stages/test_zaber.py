"""Zaber driver: the position after a move is one at rest."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.lines.serial_line import Garbled, Line
from drivers.stages.zaber import ZaberStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.motor import Motor
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from tests.support.stages.emulated_stages import LIMITS, SLOW
from tests.support.stages.memory_stages import LIMITS as MEMORY_LIMITS
from tests.support.stages.memory_stages import in_memory

pytestmark = pytest.mark.waits


class _EndsMoveInReply(ZaberController):
    """Comes to rest after the position of a reply is read and before its state is."""

    def _get(self, setting: str) -> tuple[str, str]:
        said = super()._get(setting)
        self.motor.end_move()
        return said


def test_the_final_position_is_read_at_rest_even_if_the_move_ends_during_a_reply() -> None:
    motor = Motor(SLOW, SystemClock())
    with (
        PtyWire([_EndsMoveInReply(motor)]) as wire,
        Line("theta_r", wire.port, 115200, SystemClock()) as line,
    ):
        stage = ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, LIMITS, SystemClock())
        stage.home()
        stage.start_move(0.005)  # so short that even its beginning is within the tolerance
        assert stage.wait() == pytest.approx(0.005, abs=1e-3)


def opened(controller: ZaberController, wire: PtyWire) -> ZaberStage:
    """A stage on a line that is closed with it."""
    clock = SystemClock()
    line = Line("theta_r", wire.port, 115200, clock)
    try:
        return ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, LIMITS, clock)
    except BaseException:
        line.close()
        raise


@pytest.mark.parametrize("before", [0, 1])
def test_a_device_without_checksums_is_told_to_send_them(before: int) -> None:
    controller = ZaberController(Motor(SLOW, SystemClock()))
    controller.settings["comm.checksum"] = before
    with PtyWire([controller]) as wire:
        stage = opened(controller, wire)
        assert stage.status().homed is False
        said = stage.settings()["comm.checksum"]
        stage.close()
        sent = b"".join(data for _, data in wire.seen)
    assert controller.settings["comm.checksum"] == 1
    assert ("set by this program" in said) == (before == 0)
    assert (b"set comm.checksum 1" in sent) == (before == 0)


def test_a_reply_that_loses_its_checksum_later_is_not_believed() -> None:
    controller = ZaberController(Motor(SLOW, SystemClock()))
    with PtyWire([controller]) as wire:
        stage = opened(controller, wire)
        controller.settings["comm.checksum"] = 0  # another program, or its factory settings
        with pytest.raises(Garbled, match=r"without its checksum.*comm.checksum is 0 again"):
            stage.status()
        stage.close()


def test_a_device_that_cannot_send_checksums_is_refused_and_says_what_to_do() -> None:
    controller = ZaberController(Motor(SLOW, SystemClock()))
    del controller.settings["comm.checksum"]  # an old firmware might not know it
    refused = pytest.raises(DeviceError, match=r"BADCOMMAND.*no checksum.*set comm.checksum to 1")
    with PtyWire([controller]) as wire, refused:
        opened(controller, wire)


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("speed_deg_per_s", "maxspeed of 1e-05 deg/s is less than the device's step of 0.000143"),
        ("acceleration_deg_per_s2", "accel of 1e-05 deg/s2 is less than the device's step of 1.43"),
    ],
)
def test_a_speed_below_the_devices_step_is_refused(
    key: str, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An acceleration of 0 would mean no ramp at all."""
    stage = in_memory("zaber", monkeypatch, limits=replace(MEMORY_LIMITS, **{key: 1e-5})).open()
    with pytest.raises(DeviceError, match=says):
        stage.home()


def test_a_stopped_move_is_flagged_and_no_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = replace(MEMORY_LIMITS, speed_deg_per_s=10.0, acceleration_deg_per_s2=100.0)
    found = in_memory("zaber", monkeypatch, limits=slow)
    stage = found.open()
    stage.home()
    stage.start_move(60.0)
    found.clock.sleep(1.0)
    stage.stop()
    assert stage.homed()
    assert any(b" NI " in reply for reply in found.wire.genuine)
    stage.start_move(0.0)
    assert stage.wait() == pytest.approx(0.0, abs=1e-3)


class _Stripped(ZaberController):
    """Device behind something that cuts its checksums off."""

    def _reply(self, axis: str, number: str | None, flag: str, data: str) -> bytes:
        return super()._reply(axis, number, flag, data).partition(b":")[0].strip() + b"\r\n"


def test_replies_whose_checksum_is_lost_on_the_way_are_named() -> None:
    controller = _Stripped(Motor(SLOW, SystemClock()))
    refused = pytest.raises(DeviceError, match=r"no checksum although comm.checksum is 1")
    with PtyWire([controller]) as wire, refused:
        opened(controller, wire)
