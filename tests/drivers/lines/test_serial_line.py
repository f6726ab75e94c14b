"""Faults of a serial line: recovery with the right value, or an error that names the stage.

Never a wrong number, never a move made twice. Each fault is tested at each moment and with each
device; tables give the expected outcomes.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.lines.serial_line import Garbled, Line, NoReply, PortGone
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.wire import Fault
from tests.support.stages.emulated_stages import EMULATED_STAGES, MECHANICS, SLOW, EmulatedStage
from tests.support.stages.kinds import SERIAL

pytestmark = pytest.mark.waits

# On a dead line: 0.5 s without a status, then a stop that is tried for 1 s. Each ends with what has
# begun, and reading the status of an AZ drive takes another second where its line is not in step.
BOUND_S = 4.0

# One spoilt answer, then none: the stage must recover, whatever it was doing.
ONCE = {
    "drop": Fault("drop"),
    "delay": Fault("delay", 0.1),
    "late": Fault("late", 0.3),  # in the midst of the next exchange: 0.15 s of time-out, 0.1 quiet
    "garbage": Fault("garbage"),
    "truncate": Fault("truncate"),
    "nul": Fault("nul"),
    "lose request": Fault("lose request"),
}
# Permanent faults, and the errors that report them.
FOR_GOOD = {
    "drop": (Fault("drop"), NoReply),
    "late": (Fault("late", 0.3), (NoReply, Garbled)),
    "garbage": (Fault("garbage"), Garbled),
    "truncate": (Fault("truncate"), Garbled),
    "lose request": (Fault("lose request"), NoReply),
    "unplug": (Fault("unplug"), PortGone),
}


# Faults of an AZ drive behind a gateway are tested in `test_modbus_bus`.


@pytest.fixture(params=SERIAL)
def emulated(request: pytest.FixtureRequest) -> Iterator[EmulatedStage]:
    with EMULATED_STAGES[request.param](MECHANICS) as emulated:
        emulated.stage.home()
        emulated.stage.start_move(10.0)
        emulated.stage.wait()
        yield emulated


def read(emulated: EmulatedStage) -> float:
    return emulated.stage.position_deg()


def move(emulated: EmulatedStage) -> float:
    emulated.stage.start_move(-40.0)
    return emulated.stage.wait()


def home(emulated: EmulatedStage) -> float:
    emulated.stage.home()
    return emulated.stage.position_deg()


ACTIONS: dict[str, tuple[Callable[[EmulatedStage], float], float]] = {
    "read": (read, 10.0),
    "move": (move, -40.0),
    "home": (home, 0.0),
}


@pytest.mark.parametrize("answer", [0, 1, 3])
@pytest.mark.parametrize("fault", ONCE)
@pytest.mark.parametrize("action", ACTIONS)
def test_one_spoilt_answer_is_recovered_from(
    emulated: EmulatedStage, action: str, fault: str, answer: int
) -> None:
    """The spoilt answer may be that to the status, to the command, or to the query after it."""
    act, expected = ACTIONS[action]
    moves = emulated.moves()
    emulated.wire.inject(*[None] * answer, ONCE[fault])
    begun_s = time.monotonic()
    assert act(emulated) == pytest.approx(expected, abs=1e-3)
    assert emulated.motor.position_deg == pytest.approx(expected, abs=1e-3)
    assert time.monotonic() - begun_s < BOUND_S
    assert emulated.moves() - moves <= 1


@pytest.mark.parametrize("fault", FOR_GOOD)
@pytest.mark.parametrize("action", ACTIONS)
def test_a_line_that_stays_bad_is_an_error_in_time(
    emulated: EmulatedStage, action: str, fault: str
) -> None:
    act, _ = ACTIONS[action]
    spoilt, error = FOR_GOOD[fault]
    moves = emulated.moves()
    emulated.wire.inject(*[spoilt] * 200)
    begun_s = time.monotonic()
    with pytest.raises(error, match="theta_r") as failed:
        act(emulated)
    assert time.monotonic() - begun_s < BOUND_S
    assert str(emulated.wire.port) in str(failed.value)
    assert "look at" in str(failed.value)
    assert emulated.moves() - moves <= 1


@pytest.mark.parametrize("answer", range(4))
def test_a_line_that_goes_bad_during_a_move_ends_it_in_time(
    emulated: EmulatedStage, answer: int
) -> None:
    emulated.wire.inject(*[None] * answer, *[Fault("drop")] * 200)
    begun_s = time.monotonic()
    with pytest.raises(NoReply, match="theta_r"):
        move(emulated)
    assert time.monotonic() - begun_s < BOUND_S


def test_a_late_answer_is_never_taken_for_another(emulated: EmulatedStage) -> None:
    """Position asked while it comes late, then moved, then asked again, over and over."""
    for angle_deg in (20.0, -20.0, 30.0):
        emulated.wire.inject(Fault("late", 0.4))
        emulated.stage.position_deg()
        emulated.stage.start_move(angle_deg)
        assert emulated.stage.wait() == pytest.approx(angle_deg, abs=1e-3)
        assert emulated.stage.position_deg() == pytest.approx(angle_deg, abs=1e-3)


def test_a_stop_is_sent_while_a_reply_is_pending() -> None:
    for make in EMULATED_STAGES.values():
        with make(SLOW) as emulated:
            emulated.stage.home()
            emulated.stage.start_move(70.0)
            emulated.wire.inject(Fault("drop"), Fault("drop"))
            asking = threading.Thread(target=_ask, args=(emulated,))
            sent = len(emulated.wire.seen)
            asking.start()
            while len(emulated.wire.seen) == sent:
                time.sleep(0.001)  # until the question is out; it is never answered
            sent, begun_s = len(emulated.wire.seen), time.monotonic()
            emulated.stage.stop()
            while emulated.motor.moving:
                assert time.monotonic() - begun_s < 0.3
                time.sleep(0.001)
            asking.join(BOUND_S)


def test_a_missing_port_is_named_with_advice(tmp_path: Path) -> None:
    with pytest.raises(PortGone, match=r"theta_r: cannot open .*nowhere.*look at the cable"):
        Line("theta_r", str(tmp_path / "nowhere"), 57600, SystemClock())


def _ask(emulated: EmulatedStage) -> None:
    try:
        emulated.stage.position_deg()
    except DeviceError:
        return
