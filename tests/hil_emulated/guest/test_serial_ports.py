"""The controllers behind ftdi_sio and cdc_acm: unplugged while they move, shared, and paused."""

from __future__ import annotations

import os
import subprocess
import termios
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import pytest

from drivers.factory import Lines, open_stage
from drivers.stages.motor_stage import MotorStage
from instrument.clock import SystemClock
from instrument.config.axes import NewportAxis, OrientalAxis, Wired, ZaberAxis
from instrument.devices import REPLY_S
from instrument.errors import ComputerPaused, DeviceError
from tests.hil_emulated.guest.devices import BUS_IDS, PORTS, plug_in, wait_for_node, wait_until
from tests.hil_emulated.link import Bench

pytestmark = pytest.mark.hil

KEYS = {
    "min_deg": -80.0, "max_deg": 80.0, "u_deg": 0.01, "speed_deg_per_s": 40.0,
    "acceleration_deg_per_s2": 80.0, "settle_s": 0.0, "homing_s": 5.0, "reply_s": 0.5,
}  # fmt: skip
FAR_DEG = 70.0


@dataclass(frozen=True)
class Place:
    """A controller at a port: its motor's name on the bench, and its settings."""

    motor: str
    port: str
    axis: Wired

    @property
    def bus_id(self) -> str | None:
        """Number of the device on the USB/IP server, None for qemu's adapters."""
        path = PORTS[self.port]
        return next((bus_id for bus_id, node in BUS_IDS.items() if node == path), None)

    def pull(self, bench: Bench) -> None:
        bench.unplug(self.bus_id or self.port)
        wait_for_node(PORTS[self.port], there=False)

    def push(self, bench: Bench) -> None:
        plug_in(self.bus_id) if self.bus_id else bench.plug(self.port)


def _newport(port: str, **more: float) -> Wired:
    return NewportAxis.model_validate({**KEYS, "driver": "newport", "port": PORTS[port], **more})


def _zaber(port: str) -> Wired:
    own = {"driver": "zaber", "port": PORTS[port], "microsteps_per_deg": 4266.666667}
    return ZaberAxis.model_validate({**KEYS, **own})


def _az(port: str) -> Wired:
    own = {"driver": "oriental", "port": PORTS[port], "parity": "E", "steps_per_deg": 1000.0}
    return OrientalAxis.model_validate({**KEYS, **own, "min_deg": -1.0})


PLACES = {
    "SMC100 on ftdi_sio": Place("theta_i", "SMC100", _newport("SMC100", min_deg=-1.0)),
    "SMC100 on cdc_acm": Place("SMC100-ACM", "SMC100-ACM", _newport("SMC100-ACM")),
    "Zaber on ftdi_sio": Place("X-RSW", "X-RSW", _zaber("X-RSW")),
    "Zaber on cdc_acm": Place("theta_r", "ZABER", _zaber("ZABER")),
    "AZ on ftdi_sio": Place("dphi", "AZ", _az("AZ")),
}


@dataclass
class Opened:
    """A stage at its place, homed."""

    place: Place
    stage: MotorStage
    bench: Bench

    def position_deg(self) -> float:
        return float(self.bench.position_deg(self.place.motor))

    def start_long_move(self) -> None:
        self.stage.start_move(FAR_DEG)
        wait_until(lambda: self.position_deg() > 5.0, "motion")

    def stands_early(self) -> None:
        wait_until(lambda: not self.bench.moving(self.place.motor), "the end of motion")
        assert self.position_deg() < FAR_DEG - 5.0


@contextmanager
def opened_at(place: Place, bench: Bench) -> Iterator[Opened]:
    port = PORTS[place.port]
    wait_for_node(port)
    with Lines(SystemClock()) as lines:
        stage = open_stage(place.motor, place.axis, port, lines)
        stage.home()
        stage.start_move(0.0)
        stage.wait()
        yield Opened(place, stage, bench)


@pytest.fixture(params=PLACES)
def opened(request: pytest.FixtureRequest, bench: Bench) -> Iterator[Opened]:
    with opened_at(PLACES[request.param], bench) as one:
        yield one


def test_an_axis_whose_port_comes_back_is_stopped(opened: Opened) -> None:
    """The plug is out while the axis moves; the stop reaches it by the port that returned."""
    opened.start_long_move()
    opened.place.pull(opened.bench)
    back = threading.Timer(0.2, opened.place.push, [opened.bench])
    back.start()
    with pytest.raises(DeviceError, match=PORTS[opened.place.port]):
        opened.stage.wait()
    opened.stage.stop()
    back.join()
    opened.stands_early()
    opened.stage.home()
    opened.stage.start_move(10.0)
    assert opened.stage.wait() == pytest.approx(10.0, abs=0.05)


def test_a_port_in_use_is_refused(opened: Opened) -> None:
    """By its link, and by the node's own name, under which only the system knows it."""
    link = PORTS[opened.place.port]
    node = os.path.realpath(link)
    for port, message in ((link, f"{link} is in use by"), (node, f"cannot open {node}")):
        with Lines(SystemClock()) as lines, pytest.raises(DeviceError, match=message):
            open_stage("another", opened.place.axis.model_copy(update={"port": port}), port, lines)
    opened.stage.start_move(1.0)
    assert opened.stage.wait() == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("opened", ["AZ on ftdi_sio"], indirect=True)
def test_even_parity_is_set_at_the_port(opened: Opened) -> None:
    descriptor = os.open(PORTS["AZ"], os.O_RDWR | os.O_NOCTTY)
    try:
        control = termios.tcgetattr(descriptor)[2]
    finally:
        os.close(descriptor)
    assert control & termios.PARENB
    assert not control & termios.PARODD


@pytest.mark.parametrize("name", ["SMC100 on ftdi_sio", "Zaber on cdc_acm"])
def test_a_pause_of_the_program_is_named_and_the_stage_moves_on(name: str, bench: Bench) -> None:
    """With the usual time for an answer, a status may be 0.5 s old while the stage moves."""
    place = PLACES[name]
    changes = {"reply_s": REPLY_S, "speed_deg_per_s": 10.0}
    with opened_at(replace(place, axis=place.axis.model_copy(update=changes)), bench) as opened:
        opened.start_long_move()
        with paused(0.9), pytest.raises(ComputerPaused, match="the computer paused for"):
            opened.stage.wait()
        opened.stands_early()
        assert opened.stage.homed()
        opened.stage.start_move(10.0)
        assert opened.stage.wait() == pytest.approx(10.0, abs=0.05)


@contextmanager
def paused(seconds: float) -> Iterator[None]:
    """Stop this whole process, as Ctrl-Z does, and let it go on."""
    ours = os.getpid()
    script = f"kill -STOP {ours}; sleep {seconds}; kill -CONT {ours}"
    with subprocess.Popen(["sh", "-c", script]) as pausing:
        yield
        assert pausing.wait() == 0
