"""Port that vanishes and comes back: the stop is sent, and only the same device is used again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from drivers.lines.serial_line import REOPEN_EVERY_S, REOPEN_S, Line, PortGone
from drivers.stages.motor_stage import MotorStage
from drivers.stages.newport import NewportStage
from instrument.errors import DeviceError
from sim.emulated.motor import Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import ZaberController
from tests.support.stages.emulated_stages import LIMITS, SLOW
from tests.support.stages.kinds import SERIAL, controller_for, open_stage
from tests.support.stages.plug import EventfulClock, Plug
from tests.support.stages.waiting import wait_until

pytestmark = pytest.mark.waits

SLOWLY = replace(
    LIMITS,
    speed_deg_per_s=SLOW.speed_deg_per_s,
    acceleration_deg_per_s2=SLOW.acceleration_deg_per_s2,
)


class Setup:
    """A homed stage on a plug; sleeps between tries to open its port take no time."""

    def __init__(self, kind: str, link: Path, clock: EventfulClock | None = None) -> None:
        self.kind, self.clock = kind, clock or EventfulClock(REOPEN_EVERY_S)
        self.motor = Motor(SLOW, self.clock)
        controller, self.moves = controller_for(kind, self.motor, self.clock)
        self.plug = Plug(link, controller)
        self.stage: MotorStage = open_stage(kind, str(link), SLOWLY, self.clock)
        self.stage.home()

    def lose_port_in_a_move(self) -> None:
        self.stage.start_move(70.0)  # takes 3.5 s
        wait_until(lambda: self.motor.position_deg > 1.0)
        self.plug.pull_out()
        with pytest.raises(PortGone, match=r"theta_r.*is gone|cannot open"):
            self.stage.wait()


@pytest.fixture(params=SERIAL)
def setup(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Setup]:
    made = Setup(request.param, tmp_path / "usb-adapter")
    yield made
    made.stage.close()
    made.plug.pull_out()


def test_a_stop_is_sent_over_a_port_that_comes_back(setup: Setup) -> None:
    setup.lose_port_in_a_move()
    setup.clock.then = setup.plug.put_in
    assert setup.motor.moving
    setup.stage.stop()
    wait_until(lambda: not setup.motor.moving)
    assert 1.0 < setup.motor.position_deg < 60.0


def test_the_stage_is_used_again_once_it_is_back(setup: Setup) -> None:
    setup.lose_port_in_a_move()
    setup.clock.then = setup.plug.put_in
    setup.stage.stop()
    assert setup.stage.homed()
    here_deg = setup.stage.position_deg()
    assert here_deg == pytest.approx(setup.motor.position_deg, abs=1e-2)
    setup.stage.start_move(here_deg + 1.0)
    assert setup.stage.wait() == pytest.approx(here_deg + 1.0, abs=1e-2)


def test_a_port_that_stays_away_is_an_error_after_2_s(setup: Setup) -> None:
    setup.plug.pull_out()
    begun_s = setup.clock.now_s()
    with pytest.raises(PortGone, match=r"theta_r.*look at"):
        setup.stage.stop()
    assert REOPEN_S < setup.clock.now_s() - begun_s < 1.5 * REOPEN_S


def test_three_ports_that_stay_away_take_as_long_as_one(tmp_path: Path) -> None:
    clock = EventfulClock(REOPEN_EVERY_S)
    setups = [Setup(kind, tmp_path / kind, clock) for kind in SERIAL]
    for setup in setups:
        setup.plug.pull_out()
    begun_s = clock.now_s()
    for setup in setups:
        setup.stage.begin_stop()
    for setup in setups:
        with pytest.raises(PortGone, match=r"theta_r: stop not sent, and not read to stand"):
            setup.stage.finish_stop()
    assert clock.now_s() - begun_s < 1.5 * REOPEN_S
    for setup in setups:
        setup.stage.close()


def test_a_numbered_name_is_opened_again_for_a_stop_only(
    setup: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """/dev/ttyUSB0 may belong to another device by then."""
    for module in ("serial_line", "modbus_bus"):
        monkeypatch.setattr(f"drivers.lines.{module}.names_one_device", lambda _: False)
    numbered = Setup(setup.kind, tmp_path / "ttyUSB0")
    numbered.lose_port_in_a_move()
    numbered.clock.then = numbered.plug.put_in
    with pytest.raises(PortGone, match=r"told to stop .* not read to stand.* it may still move"):
        numbered.stage.stop()
    wait_until(lambda: not numbered.motor.moving)
    moves = numbered.moves()
    for action in (numbered.stage.position_deg, numbered.stage.home):
        with pytest.raises(PortGone, match="name it by its link in /dev/serial/by-id"):
            action()
    assert numbered.moves() == moves
    received = numbered.plug.wire.received  # several stops may arrive in one piece
    sent = received()
    with pytest.raises(PortGone, match="not read to stand"):
        numbered.stage.stop()
    wait_until(lambda: received() > sent)  # and a stop reaches it still
    numbered.plug.pull_out()


@pytest.mark.parametrize("setup", ["newport", "zaber"], indirect=True)
def test_another_device_under_the_same_link_is_refused(setup: Setup) -> None:
    setup.plug.pull_out()
    motor = Motor(SLOW, setup.clock)
    motor.referenced = True
    other: Any
    if setup.kind == "newport":
        other = NewportController(motor, stage="LTA-HS_PN:B0601246985104_UD:062510")
    else:
        other = ZaberController(motor)
        other.settings |= {"system.serial": 75002, "comm.checksum": 1}
    with pytest.raises(DeviceError, match="theta_r"):
        setup.stage.position_deg()
    setup.plug.put_in(other)
    with pytest.raises(DeviceError, match=r"now, and .* before: look at what is connected"):
        setup.stage.start_move(5.0)
    assert other.moves == 0


def test_a_closed_line_is_not_opened_again(setup: Setup) -> None:
    setup.stage.close()
    for action in (setup.stage.position_deg, setup.stage.stop):
        with pytest.raises(PortGone, match="closed"):
            action()


@pytest.fixture
def held() -> Iterator[tuple[NewportStage, PtyWire, Motor]]:
    """A stage on a line with XON/XOFF which a byte of noise has halted."""
    clock = EventfulClock(REOPEN_EVERY_S)
    motor = Motor(SLOW, clock)
    with (
        PtyWire([NewportController(motor)]) as wire,
        Line("theta_r", wire.port, 57600, clock, xonxoff=True) as line,
    ):
        stage = NewportStage("theta_r", line, 1, "SMC100", SLOWLY, clock)
        stage.home()
        stage.start_move(70.0)
        wire.send_noise(XOFF)
        yield stage, wire, motor
        stage.close()


XOFF = b"\x13"


def test_a_stop_passes_a_line_that_an_xoff_holds(
    held: tuple[NewportStage, PtyWire, Motor],
) -> None:
    stage, _, motor = held
    stage.stop()
    assert not motor.moving
    assert motor.position_deg < 60.0


@pytest.mark.parametrize("lost", [1, 2])
def test_a_stop_is_sent_again_where_xoffs_hold_the_line_and_stops_are_lost(
    held: tuple[NewportStage, PtyWire, Motor], lost: int
) -> None:
    """Each lost stop is followed by another XOFF, so that the status cannot be asked for."""
    stage, wire, motor = held
    left = [b"T"] * lost

    def spoilt(data: bytes) -> bytes:
        if b"ST" not in data or not left:
            return data
        wire.send_noise(XOFF)
        return data.replace(b"S", left.pop())

    wire.spoil_request = spoilt
    stage.stop()
    assert not left
    assert not motor.moving
    assert motor.position_deg < 60.0


def test_bytes_that_the_system_holds_back_are_discarded_before_a_stop(
    held: tuple[NewportStage, PtyWire, Motor], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A driver of a real port queues what an XOFF holds; here the port only says so."""
    line = held[0]._port.line
    port = line._serial
    done: list[str] = []
    monkeypatch.setattr(port, "reset_output_buffer", lambda: done.append("discarded"))
    queue = [5, 2]  # bytes on their way are left alone
    monkeypatch.setattr(type(port), "out_waiting", property(lambda _: queue.pop(0)))
    line._free_output(port)
    assert not done
    queue.extend([5, 5])
    line._free_output(port)
    assert done == ["discarded"]


def test_a_query_recovers_from_an_xoff(held: tuple[NewportStage, PtyWire, Motor]) -> None:
    stage, _, motor = held
    assert stage.position_deg() <= motor.position_deg
