"""What every stage promises, whatever controller is behind it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.lines.priority_lock import PriorityLock
from drivers.lines.serial_line import Garbled, Line, PortGone
from drivers.stages import newport_framing, zaber_framing
from drivers.stages.motion import Status
from drivers.stages.motor_stage import MotorStage, Stopped
from drivers.stages.newport import NewportStage
from drivers.stages.zaber import ZaberStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.clock import SimulatedClock
from sim.emulated.motor import Motor
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from tests.support.stages.emulated_stages import (
    EMULATED_STAGES,
    LIMITS,
    MECHANICS,
    SLOW,
    EmulatedStage,
)

pytestmark = pytest.mark.waits

DEADLINE_S = 5.0


def until(condition: Callable[[], bool]) -> None:
    """Wait for something to happen; the deadline is only for when it does not."""
    end_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end_s, "did not happen in time"
        time.sleep(0.001)


@pytest.fixture(params=list(EMULATED_STAGES))
def make(request: pytest.FixtureRequest) -> Callable[..., AbstractContextManager[EmulatedStage]]:
    return EMULATED_STAGES[request.param]


@pytest.fixture
def bench(make: Callable[..., AbstractContextManager[EmulatedStage]]) -> Iterator[EmulatedStage]:
    with make(MECHANICS) as bench:
        yield bench


def test_it_says_who_answers(bench: EmulatedStage) -> None:
    assert any(maker in bench.stage.identity() for maker in ("SMC100", "Zaber", "AZ"))
    # The port is none of it: a plug may move to another.
    assert str(bench.wire.port) not in bench.stage.identity()


def test_nothing_moves_before_homing(bench: EmulatedStage) -> None:
    with pytest.raises(DeviceError, match=r"theta_r.*not homed.*home it first"):
        bench.stage.start_move(10.0)
    assert bench.moves() == 0


def test_past_the_narrower_limit_not_a_byte_is_sent(bench: EmulatedStage) -> None:
    bench.stage.home()
    assert bench.stage.limits_deg() == pytest.approx((-90.0, bench.max_deg), abs=1e-3)
    sent = len(bench.wire.seen)
    for angle_deg in (bench.max_deg + 0.001, 1e6, -90.001, float("nan"), float("inf")):
        with pytest.raises(DeviceError, match=r"theta_r: .* deg asked for; its limits are -90 to"):
            bench.stage.start_move(angle_deg)
    assert len(bench.wire.seen) == sent


def test_it_goes_where_it_is_told(bench: EmulatedStage) -> None:
    bench.stage.home()
    assert bench.stage.position_deg() == pytest.approx(0.0, abs=1e-3)
    for angle_deg in (10.0, -90.0, 79.9, 79.9, 79.901, 0.0):
        bench.stage.start_move(angle_deg)
        assert bench.stage.wait() == pytest.approx(angle_deg, abs=1e-3)
        assert bench.motor.position_deg == pytest.approx(angle_deg, abs=1e-3)


def test_a_move_begins_at_once_and_is_waited_for(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as bench:
        bench.stage.home()
        begun_s = time.monotonic()
        bench.stage.start_move(5.0)
        assert time.monotonic() - begun_s < 0.1
        assert 0 <= bench.stage.position_deg() < 5.0
        assert bench.stage.wait() == pytest.approx(5.0, abs=1e-3)
        assert time.monotonic() - begun_s > 0.2  # 5 degrees at 20 deg/s


def test_homing_twice_is_no_harm(bench: EmulatedStage) -> None:
    bench.stage.home()
    bench.stage.start_move(20.0)
    bench.stage.wait()
    bench.stage.home()
    assert bench.stage.position_deg() == pytest.approx(0.0, abs=1e-3)


def test_a_stop_from_another_thread_ends_the_move(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as bench:
        bench.stage.home()
        bench.stage.start_move(70.0)
        until(lambda: bench.motor.position_deg > 1.0)
        stopper = threading.Timer(0.05, bench.stage.stop)
        stopper.start()
        with pytest.raises(Stopped, match=r"theta_r: stopped at [\d.]+ deg"):
            bench.stage.wait()
        stopper.join()
        until(lambda: not bench.motor.moving)  # on the wire is not yet read
        assert 1.0 < bench.motor.position_deg < 60.0
        bench.stage.stop()
        bench.stage.start_move(0.0)  # and it may be told to go on
        assert bench.stage.wait() == pytest.approx(0.0, abs=1e-3)


def test_a_stop_of_a_stage_that_stands_is_no_harm(bench: EmulatedStage) -> None:
    bench.stage.stop()
    bench.stage.home()
    bench.stage.stop()
    bench.stage.stop()
    bench.stage.start_move(3.0)
    assert bench.stage.wait() == pytest.approx(3.0, abs=1e-3)


def test_a_stop_is_on_the_wire_at_once(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as bench:
        bench.stage.home()
        bench.stage.start_move(70.0)
        sent, asked_s = len(bench.wire.seen), time.monotonic()
        bench.stage.stop()
        until(lambda: len(bench.wire.seen) > sent)
        assert bench.wire.seen[sent][0] - asked_s < 0.1
        until(lambda: not bench.motor.moving)


def test_what_holds_the_stage_is_a_stall(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as bench:
        bench.stage.home()
        bench.stage.start_move(40.0)
        until(lambda: bench.motor.position_deg > 1.0)
        bench.motor.hold()
        with pytest.raises(DeviceError, match=r"stalled at .* on the way to 40 deg.*holds"):
            bench.stage.wait()
        until(lambda: not bench.motor.moving)  # it was told to stop pushing


def test_an_alarm_is_named_with_its_code_and_nothing_moves(
    make: Callable[..., AbstractContextManager[EmulatedStage]],
) -> None:
    with make(SLOW) as bench:
        bench.stage.home()
        bench.stage.start_move(40.0)
        bench.motor.fail(bench.alarm)
        code = bench.alarm.lstrip("0")
        with pytest.raises(DeviceError, match=rf"theta_r: .*{code}.*look for what holds the stage"):
            bench.stage.wait()
        moves = bench.moves()
        with pytest.raises(DeviceError, match=code):
            bench.stage.start_move(10.0)
        with pytest.raises(DeviceError, match=code):
            bench.stage.home()
        assert bench.moves() == moves


def test_a_reference_that_is_not_found_ends_the_homing(bench: EmulatedStage) -> None:
    bench.motor.homing_fails = True
    with pytest.raises(DeviceError, match=r"reference was not found within 3 s.*reference switch"):
        bench.stage.home()
    until(lambda: not bench.motor.homing)


class Parrot:
    """Answers everything with the same words."""

    def __init__(self, words: bytes) -> None:
        self._words = words

    def answer(self, _: bytes) -> bytes:
        return self._words


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            b"1VE ESP301 Version 3.0.1\r\n",
            "calls itself 'ESP301 Version 3.0.1'; expected: a SMC100",
        ),
        (b"@01 0 OK IDLE -- 0\r\n", "only b'@01 0 OK IDLE -- 0'"),
        (b"", "no answer within 0.15 s: look at its power and at the cable"),
    ],
)
def test_a_wrong_device_is_refused_with_what_it_said(words: bytes, says: str) -> None:
    with PtyWire([Parrot(words)]) as wire, Line("theta_r", wire.port, 57600, SystemClock()) as line:
        with pytest.raises(DeviceError) as refused:
            NewportStage("theta_r", line, 1, "SMC100", LIMITS, SystemClock())
        assert says in str(refused.value)
        assert str(wire.port) in str(refused.value)


def test_a_port_that_is_not_there_says_what_to_look_at(tmp_path: Path) -> None:
    with pytest.raises(PortGone, match=r"theta_r: cannot open .*nowhere.*look at the cable"):
        Line("theta_r", str(tmp_path / "nowhere"), 57600, SystemClock())


# Framing, against bytes from the makers' manuals.


def test_newport_commands_are_the_manual_s_bytes() -> None:
    assert newport_framing.command(1, "TP") == b"1TP\r\n"
    assert newport_framing.command(1, "PA", 12.5) == b"1PA12.5\r\n"
    assert newport_framing.command(1, "PA", -0.0000004) == b"1PA-0\r\n"
    assert newport_framing.command(2, "SL", "?") == b"2SL?\r\n"


def test_newport_answers_belong_to_their_question() -> None:
    assert newport_framing.answer_to(1, "TP", b"1TP12.5") == "12.5"
    assert newport_framing.answer_to(1, "TP", b"1TS000033") is None
    assert newport_framing.answer_to(1, "TP", b"2TP12.5") is None
    assert newport_framing.answer_to(1, "TP", b"1TP12.\xff5") is None
    assert newport_framing.answer_to(1, "TE", b"1TE@") == "@"


@pytest.mark.parametrize(
    ("text", "name", "moving", "homed", "fault"),
    [
        ("00000A", "not referenced", False, False, ""),
        ("00001E", "homing", True, False, ""),
        ("000028", "moving", True, True, ""),
        ("000032", "ready", False, True, ""),
        ("000036", "ready", False, True, ""),
        ("00003C", "disabled", False, True, "motor disabled"),
        ("000014", "configuration", False, False, "configuration state"),
        ("00200E", "not referenced", False, False, "0020 following error"),
        ("008033", "ready", False, True, "0080 wrong stage"),
        ("040033", "ready", False, True, "0400 unknown"),
    ],
)
def test_newport_states(text: str, name: str, moving: bool, homed: bool, fault: str) -> None:
    state = newport_framing.state("theta_r", text)
    assert (state.name, state.moving, state.homed) == (name, moving, homed)
    assert (fault in state.fault) if fault else (state.fault == "")


@pytest.mark.parametrize("text", ["", "0000", "00003G", "0000331", "0000FF"])
def test_newport_states_that_are_none(text: str) -> None:
    with pytest.raises(Garbled, match="theta_r: answers TS with"):
        newport_framing.state("theta_r", text)


class _StandsBetween(ZaberController):
    """Its axis comes to rest after the position of a reply was read, before its state is."""

    def _get(self, setting: str) -> tuple[str, str]:
        said = super()._get(setting)
        self.motor.end_move()
        return said


def test_a_zaber_position_is_one_of_rest_even_when_the_move_ends_within_a_reply() -> None:
    motor = Motor(SLOW, SystemClock())
    with (
        PtyWire([_StandsBetween(motor)]) as wire,
        Line("theta_r", wire.port, 115200, SystemClock()) as line,
    ):
        stage = ZaberStage("theta_r", line, 1, 1, MICROSTEPS_PER_DEG, LIMITS, SystemClock())
        stage.home()
        stage.start_move(0.005)  # so short that even its beginning is within the tolerance
        assert stage.wait() == pytest.approx(0.005, abs=1e-3)


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


def test_whether_it_knows_its_reference_is_asked_of_a_stage_at_rest() -> None:
    braking = _Braking(asked_while_moving=7)
    assert braking.homed()
    assert braking._left == -1
    with pytest.raises(DeviceError, match=r"theta_r: still moves .* cut its power"):
        _Braking(asked_while_moving=10_000).homed()


def test_zaber_checksum_is_the_manual_s() -> None:
    assert zaber_framing.checksum(b"1 0 move abs 10000") == b"41"
    assert zaber_framing.command(1, 1, 7, "home").startswith(b"/1 1 07 home:")


def test_zaber_replies_are_taken_apart() -> None:
    body = b"01 1 07 OK BUSY WR 153600"
    reply = zaber_framing.reply_of(b"@" + body + b":" + zaber_framing.checksum(body))
    assert reply == zaber_framing.Reply(
        device=1, axis=1, message_id=7, accepted=True, busy=True, warning="WR", data="153600"
    )
    assert not zaber_framing.homed([reply.warning])


@given(st.binary(max_size=60))
def test_noise_is_no_reply(noise: bytes) -> None:
    assert zaber_framing.reply_of(noise) is None
    assert newport_framing.answer_to(1, "TP", b"\xff" + noise) is None


@given(st.integers(1, 99), st.integers(0, 9), st.integers(0, 99), st.integers(0, 255), st.data())
def test_one_changed_byte_makes_no_reply(
    device: int, axis: int, number: int, change: int, data: st.DataObject
) -> None:
    body = f"{device:02d} {axis} {number:02d} OK IDLE -- 153600".encode()
    line = bytearray(b"@" + body + b":" + zaber_framing.checksum(body))
    at = data.draw(st.integers(1, len(body)))
    if line[at] != change:
        line[at] = change
        assert zaber_framing.reply_of(bytes(line)) is None


def test_an_urgent_turn_goes_before_those_that_wait() -> None:
    turns, order, waiting = PriorityLock(), [], threading.Barrier(3)

    def take(name: str, urgent: bool) -> None:
        waiting.wait()
        if urgent:
            until(started.is_set)
        with turns.hold(urgent):
            order.append(name)

    started = threading.Event()
    with turns.hold():
        threads = [threading.Thread(target=take, args=("asks", False)),
                   threading.Thread(target=take, args=("stops", True))]  # fmt: skip
        for thread in threads:
            thread.start()
        waiting.wait()
        started.set()
        until(lambda: turns._urgent_waiting == 1)
    for thread in threads:
        thread.join(DEADLINE_S)
    assert order == ["stops", "asks"]
