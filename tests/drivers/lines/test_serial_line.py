"""What goes wrong on a line: recovery with the right value, or an error that names the stage.

Never a wrong number, never a move made twice. One test for each fault, moment and device; the
outcomes that are expected stand in one table.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest

from drivers.lines.serial_line import Garbled, NoReply, PortGone
from instrument.errors import DeviceError
from sim.emulated.wire import Fault
from tests.support.stages.emulated_stages import EMULATED_STAGES, MECHANICS, SLOW, EmulatedStage

pytestmark = pytest.mark.waits

BOUND_S = 3.0

# One answer spoilt, then all is well: the stage must get over it, whatever it was doing.
ONCE = {
    "drop": Fault("drop"),
    "delay": Fault("delay", 0.1),
    "late": Fault("late", 0.4),
    "garbage": Fault("garbage"),
    "truncate": Fault("truncate"),
    "nul": Fault("nul"),
    "lose request": Fault("lose request"),
}
# It stays so: the error that says it.
FOR_GOOD = {
    "drop": (Fault("drop"), NoReply),
    "late": (Fault("late", 0.3), (NoReply, Garbled)),
    "garbage": (Fault("garbage"), Garbled),
    "truncate": (Fault("truncate"), Garbled),
    "lose request": (Fault("lose request"), NoReply),
    "unplug": (Fault("unplug"), PortGone),
}


# How the AZ's faults look through a gateway is in `test_oriental_faults`.
SERIAL = [name for name in EMULATED_STAGES if name != "oriental tcp"]


@pytest.fixture(params=SERIAL)
def bench(request: pytest.FixtureRequest) -> Iterator[EmulatedStage]:
    with EMULATED_STAGES[request.param](MECHANICS) as bench:
        bench.stage.home()
        bench.stage.start_move(10.0)
        bench.stage.wait()
        yield bench


def read(bench: EmulatedStage) -> float:
    return bench.stage.position_deg()


def move(bench: EmulatedStage) -> float:
    bench.stage.start_move(-40.0)
    return bench.stage.wait()


def home(bench: EmulatedStage) -> float:
    bench.stage.home()
    return bench.stage.position_deg()


ACTIONS: dict[str, tuple[Callable[[EmulatedStage], float], float]] = {
    "read": (read, 10.0),
    "move": (move, -40.0),
    "home": (home, 0.0),
}


@pytest.mark.parametrize("answer", [0, 1, 3])
@pytest.mark.parametrize("fault", ONCE)
@pytest.mark.parametrize("action", ACTIONS)
def test_one_spoilt_answer_is_got_over(
    bench: EmulatedStage, action: str, fault: str, answer: int
) -> None:
    """Whichever answer it is: to the status, to the command, to what asks after it."""
    act, expected = ACTIONS[action]
    moves = bench.moves()
    bench.wire.inject(*[None] * answer, ONCE[fault])
    begun_s = time.monotonic()
    assert act(bench) == pytest.approx(expected, abs=1e-3)
    assert bench.motor.position_deg == pytest.approx(expected, abs=1e-3)
    assert time.monotonic() - begun_s < BOUND_S
    assert bench.moves() - moves <= 1


@pytest.mark.parametrize("fault", FOR_GOOD)
@pytest.mark.parametrize("action", ACTIONS)
def test_a_line_that_stays_bad_is_named_in_time(
    bench: EmulatedStage, action: str, fault: str
) -> None:
    act, _ = ACTIONS[action]
    spoilt, error = FOR_GOOD[fault]
    moves = bench.moves()
    bench.wire.inject(*[spoilt] * 200)
    begun_s = time.monotonic()
    with pytest.raises(error, match="theta_r") as failed:
        act(bench)
    assert time.monotonic() - begun_s < BOUND_S
    assert str(bench.wire.port) in str(failed.value)
    assert "look at" in str(failed.value)
    assert bench.moves() - moves <= 1


@pytest.mark.parametrize("answer", range(4))
def test_a_line_that_goes_bad_during_a_move_ends_it_in_time(
    bench: EmulatedStage, answer: int
) -> None:
    bench.wire.inject(*[None] * answer, *[Fault("drop")] * 200)
    begun_s = time.monotonic()
    with pytest.raises(NoReply, match="theta_r"):
        move(bench)
    assert time.monotonic() - begun_s < BOUND_S


def test_a_late_answer_is_never_taken_for_another_s(bench: EmulatedStage) -> None:
    """Position asked while it comes late, then moved, then asked again, over and over."""
    for angle_deg in (20.0, -20.0, 30.0):
        bench.wire.inject(Fault("late", 0.4))
        bench.stage.position_deg()
        bench.stage.start_move(angle_deg)
        assert bench.stage.wait() == pytest.approx(angle_deg, abs=1e-3)
        assert bench.stage.position_deg() == pytest.approx(angle_deg, abs=1e-3)


def test_a_stop_goes_out_while_an_answer_is_owed() -> None:
    for make in EMULATED_STAGES.values():
        with make(SLOW) as bench:
            bench.stage.home()
            bench.stage.start_move(70.0)
            bench.wire.inject(Fault("drop"), Fault("drop"))
            import threading

            asking = threading.Thread(target=_ask, args=(bench,))
            sent = len(bench.wire.seen)
            asking.start()
            while len(bench.wire.seen) == sent:
                time.sleep(0.001)  # until the question is out; it is never answered
            sent, begun_s = len(bench.wire.seen), time.monotonic()
            bench.stage.stop()
            while bench.motor.moving:
                assert time.monotonic() - begun_s < 0.3
                time.sleep(0.001)
            asking.join(BOUND_S)


def _ask(bench: EmulatedStage) -> None:
    try:
        bench.stage.position_deg()
    except DeviceError:
        return
