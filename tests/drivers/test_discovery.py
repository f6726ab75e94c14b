"""Identification of the controllers on serial ports."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from drivers.discovery import FoundPort, identify_controller
from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import ZaberController
from tests.support.stages.plug import Echoing

pytestmark = pytest.mark.waits


@pytest.mark.parametrize(
    ("controller", "answer"),
    [
        (NewportController, r"'1VE SMC_CC - .*' when asked as Newport SMC100"),
        (ZaberController, r"'@01 0 OK IDLE .*' when asked as Zaber"),
    ],
)
def test_the_first_answer_is_quoted(
    controller: type[NewportController | ZaberController], answer: str
) -> None:
    with PtyWire([controller(Motor(Mechanics(), SystemClock()))]) as wire:
        assert re.fullmatch(answer, identify_controller(wire.port))


def test_an_adapters_echo_is_no_answer() -> None:
    controller = NewportController(Motor(Mechanics(), SystemClock()))
    with PtyWire([Echoing(controller)]) as wire:
        said = identify_controller(wire.port)
    assert re.fullmatch(r"'1VE SMC_CC - .*' when asked as Newport SMC100", said)


def test_a_silent_port_has_no_answer() -> None:
    with PtyWire([]) as wire:
        assert identify_controller(wire.port) == "no answer"


def test_a_missing_port_is_reported(tmp_path: Path) -> None:
    assert "cannot open" in identify_controller(str(tmp_path / "nowhere"))


@pytest.mark.parametrize(
    ("answer", "driver"),
    [
        ("'@01 0 OK IDLE' when asked as Zaber", "zaber"),
        ("'1VE SMC_CC' when asked as Newport SMC100", "newport"),
        ("'1VE' when asked as Newport CONEX-CC", "newport"),
        ("no answer", ""),
        ("", ""),
    ],
)
def test_the_driver_of_a_controller_that_answered(answer: str, driver: str) -> None:
    assert FoundPort(path="/dev/ttyUSB0", text="adapter", answer=answer).driver == driver
