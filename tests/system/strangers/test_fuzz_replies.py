"""Fuzzed replies of controllers: a driver returns the true position or raises a `DeviceError`.

Real drivers talk to emulated controllers over an in-memory line that damages some of the replies.
The guarantee for a damaged reply depends on its error detection:

- Modbus RTU: a CRC of 16 bits. No wrong position is accepted here.
- Zaber: a checksum of 8 bits. Any single wrong byte is detected; of larger damage 1 in 256 passes.
- Newport: none. A finite number in a reply to the same command is accepted.
- Modbus TCP: that of TCP. A gateway may mix up replies: transaction, unit and length are checked.
"""

from __future__ import annotations

import logging
import random
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU

from drivers.lines.serial_line import Garbled, number_of
from drivers.stages import newport_framing, oriental_framing, zaber_framing
from drivers.stages.motor_stage import MotorStage
from instrument.errors import DeviceError
from sim.emulated.oriental_controller import crc
from tests.support.stages.kinds import KINDS, STEPS_PER_DEG
from tests.support.stages.memory_stages import MemoryStage, Spoil, in_memory
from tests.support.strangers.mutations import Mutator, feed

ONCE_MORE_S = 10.0  # simulated; the longest action has a time-out of 2.5 s and asks three times


def status(stage: MotorStage, _: MemoryStage, __: random.Random) -> float:
    return stage.status().position_deg


def move(stage: MotorStage, _: MemoryStage, rng: random.Random) -> float:
    stage.start_move(rng.uniform(-80.0, 80.0))
    return stage.wait()


def home(stage: MotorStage, _: MemoryStage, __: random.Random) -> float:
    stage.home()
    return stage.position_deg()


def open_again(_: MotorStage, memory: MemoryStage, __: random.Random) -> float:
    return memory.open().status().position_deg


ACTIONS = (status, move, home, open_again)


@dataclass
class Session:
    """A homed stage, and the damage that its line does to replies."""

    kind: str
    memory: MemoryStage
    spoil: Spoil
    stage: MotorStage
    wrong: int = 0

    @classmethod
    def of(cls, kind: str, patch: pytest.MonkeyPatch, seed: int = 1) -> Session:
        """Return a session whose mutator knows one genuine reply to each command."""
        # pytest would keep all that is logged.
        patch.setattr(logging.getLogger("pymodbus.logging"), "disabled", True)
        memory = in_memory(kind, patch)
        stage = memory.open()
        stage.home()
        stage.start_move(10.0)
        assert stage.wait() == pytest.approx(10.0, abs=1e-3)
        examples = tuple(dict.fromkeys(memory.wire.genuine))
        return cls(kind, memory, Mutator(examples, seed).spoil, stage)

    def take(self, number: int) -> None:
        """Do one action with damaged replies, then read the position over a sound line."""
        rng = random.Random(number)
        memory, action = self.memory, rng.choice(ACTIONS)
        for kept in (memory.wire.heard, memory.wire.genuine, memory.wire.sent):
            kept.clear()
        memory.clock.readings, began_s, moves = 0, memory.clock.now_s(), memory.moves()
        memory.spoil_next(rng, self.spoil)
        said = ""
        try:
            self._judge(action(self.stage, memory, rng))
        except DeviceError as error:
            said = str(error)
        except BaseException as error:
            error.add_note(f"{action.__name__}, heard {bytes(memory.wire.heard[-2000:])!r}")
            raise
        assert said.isprintable(), "a message that is not safe for a terminal"
        assert memory.clock.now_s() - began_s < ONCE_MORE_S
        assert memory.moves() - moves <= (2 if self.kind == "oriental tcp" else 1)
        self._heal()

    def _judge(self, said_deg: float) -> None:
        true = self.is_true(said_deg)
        if self.kind == "newport":
            assert true or said_deg in self._newport_numbers()
        elif self.kind == "oriental rtu":
            assert true, f"{said_deg} deg, and it stands at {self.memory.motor.position_deg} deg"
        self.wrong += not true

    def is_true(self, said_deg: float) -> bool:
        return abs(said_deg - self.memory.motor.position_deg) < 2 / STEPS_PER_DEG

    def _newport_numbers(self) -> set[float | None]:
        """Return the numbers in complete replies to TP."""
        lines = bytes(self.memory.wire.heard).replace(b"\0", b"").split(b"\n")
        answers = [line.strip(b"\r")[3:] for line in lines if line.startswith(b"1TP")]
        return {number_of(text.decode("latin-1").strip()) for text in answers}

    def _heal(self) -> None:
        self.memory.wire.spoil = lambda answer: answer
        self.memory.clock.readings = 0
        self.memory.clock.sleep(1.0)  # any motion has ended
        assert self.is_true(self.stage.status().position_deg), "wrong over an undamaged line"
        if not self.memory.motor.referenced:
            self.stage.home()


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_replies_give_the_true_position_or_an_error(
    kind: str, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, count = Session.of(kind, monkeypatch), 10_000 if slow else 40
    feed(lambda number: str(number).encode(), count, lambda data: session.take(int(data)))
    if kind == "zaber":
        assert session.wrong <= count / 256


def _signed(kind: str, answer: bytes) -> bytes:
    """Return the contents of a reply in a frame with a valid checksum."""
    if kind == "zaber":
        body = answer.partition(b":")[0].lstrip(b"@")
        return b"@%b:%02X\r\n" % (body, -sum(body) & 0xFF)
    if kind == "oriental rtu":
        return answer[:-2] + crc(answer[:-2])
    if kind == "oriental tcp":
        return answer[:4] + (max(len(answer) - 6, 0) & 0xFFFF).to_bytes(2, "big") + answer[6:]
    return answer.strip() + b"\r\n"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_wrong_replies_with_a_valid_checksum_give_a_result_or_an_error(
    kind: str, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No check can detect them, but nothing else breaks."""
    session = Session.of(kind, monkeypatch, seed=2)
    damaged = session.spoil
    session.spoil = lambda rng, answer: _signed(kind, damaged(rng, answer))
    session.kind = "oriental tcp"  # a wrong value may be accepted, and a wrong target be answered
    feed(
        lambda number: str(number).encode(),
        10_000 if slow else 40,
        lambda data: session.take(int(data)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["zaber", "oriental rtu"])
def test_one_wrong_byte_in_a_position_is_never_accepted(
    kind: str, slow: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both checksums detect every error within one byte, at every position of the frame."""
    session = Session.of(kind, monkeypatch)
    length = len(session.memory.wire.genuine[-1])
    masks = range(1, 256) if slow else (1, 16)
    for number in range(length * len(masks)):
        at, mask = number % length, masks[number // length]

        def damaged(answer: bytes, at: int = at, mask: int = mask) -> bytes:
            place = at % len(answer)
            return answer[:place] + bytes([answer[place] ^ mask]) + answer[place + 1 :]

        session.memory.clock.readings, session.memory.wire.spoil = 0, damaged
        try:
            taken = session.stage.status().position_deg
        except Garbled:
            continue
        assert session.is_true(taken), (at, mask)


def test_mixed_up_replies_of_a_gateway_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Complete replies to other requests, units and transactions, and parts of them."""
    session = Session.of("oriental tcp", monkeypatch)
    earlier = list(session.memory.wire.genuine)

    def mixed(rng: random.Random, answer: bytes) -> bytes:
        kind = rng.randrange(4)
        if kind == 0:
            return rng.choice(earlier)
        if kind == 1:
            return answer[: rng.randrange(len(answer))]
        place = rng.choice((0, 1, 6)) if kind == 2 else rng.choice((2, 3, 4, 5))
        return answer[:place] + bytes([answer[place] ^ rng.randrange(1, 256)]) + answer[place + 1 :]

    session.spoil = mixed
    for number in range(60):
        session.take(number)
    assert session.wrong == 0


_NEWPORT = (
    b"1TP-12.500000\r", b"1TS000033\r", b"1TS002028\r", b"1SL-95\r", b"1VA1.2E-05\r",
    b"1VE SMC100_CC_Controller-driver version  2.0.0\r",
)  # fmt: skip
_ZABER = (
    b"@01 1 07 OK IDLE -- -53333:1A\r", b"@01 0 01 OK IDLE WH 59999:AC\r",
    b"@01 1 33 RJ BUSY -- BADDATA:6F\r", b"@01 1 05 OK BUSY FS 02 FS WH:9B\r", b"!01 1 IDLE --\r",
)  # fmt: skip
FRAMED = 100_000


@pytest.mark.slow
def test_newport_framing_reads_any_line(slow: bool) -> None:
    """Returns None, printable text, a finite number or a known state, or raises `Garbled`."""

    def read(line: bytes) -> None:
        for letters in ("TP", "TS", "VE"):
            text = newport_framing.answer_to(1, letters, line)
            if text is None:
                continue
            assert line.startswith(f"1{letters}".encode())
            assert text.isprintable()
            _or_garbled(lambda text=text: newport_framing.number("stage", "TP", text), _finite)
            _or_garbled(lambda text=text: newport_framing.state("stage", text), _state)

    feed(Mutator(_NEWPORT, 3), FRAMED if slow else 300, read)


def _or_garbled(read: Callable[[], object], check: Callable[[object], None]) -> None:
    try:
        found = read()
    except Garbled:
        return
    check(found)


def _finite(value: object) -> None:
    assert isinstance(value, float)
    assert abs(value) < float("inf")


def _state(state: object) -> None:
    assert isinstance(state, newport_framing.State)
    assert 0 <= state.errors <= 0xFFFF
    assert not (state.homed and state.name in ("not referenced", "homing", "configuration"))
    assert state.fault.isprintable()


@pytest.mark.slow
def test_zaber_framing_reads_any_line(slow: bool) -> None:
    """An accepted reply has a valid checksum and only printable characters."""

    def read(line: bytes) -> None:
        for one in (line, _signed("zaber", line).rstrip(b"\r\n")):
            reply = zaber_framing.reply_of(one)
            if reply is None:
                continue
            body, check = one[1:].split(b":")
            assert (sum(body) + int(check, 16)) % 256 == 0
            assert (reply.warning + reply.data).isprintable()
            assert zaber_framing.fault([reply.warning, *reply.data.split()]).isprintable()

    feed(Mutator(_ZABER, 4, [b":", b"@", b" "]), FRAMED if slow else 500, read)


@pytest.mark.slow
def test_oriental_framing_reads_any_registers(slow: bool) -> None:
    """Registers of any 16 bits are recognised as not of an AZ drive, or read as such."""

    def read(data: bytes) -> None:
        words = [data[i] << 8 | data[i + 1] for i in range(0, 40, 2)]
        direct = oriental_framing.direct_data_of(words[:16])
        output = oriental_framing.output_of(words[16:])
        values = (direct.position, direct.speed_hz, output.alarm)
        assert all(-(1 << 31) <= value < 1 << 31 for value in values)
        again = oriental_framing.words_of(direct.position)
        assert again == (words[4], words[5])
        if not oriental_framing.az_mismatch(direct, output):
            assert bool(output.fault) == bool(output.alarm)
        assert (output.fault + str(direct)).isprintable()

    examples = (bytes(40), bytes.fromhex("0000000000000001FFFFFF9C") + bytes(28))
    spoilt = Mutator(examples, 5)
    feed(lambda n: (spoilt(n) + bytes(40))[:40], FRAMED if slow else 500, read)


@pytest.mark.slow
def test_a_frame_that_the_modbus_framer_accepts_has_a_valid_crc(slow: bool) -> None:
    """pymodbus parses frames and finds one after noise: the driver relies on its CRC check."""
    framer = FramerRTU(DecodePDU(False))
    frames = [bytes.fromhex(text) for text in (
        "010304FFFFFF9C", "0103080000403000000000", "0106007D0020", "011000580010", "018302",
    )]  # fmt: skip

    def read(data: bytes) -> None:
        for frame in (data, data + crc(data)):
            try:
                _, pdu = framer.handleFrame(frame, 1, 0)
            except (ModbusException, ValueError, IndexError):
                continue  # the bus raises `Garbled` for it
            if pdu is not None:
                assert any(
                    crc(frame[first:last]) == frame[last : last + 2]
                    for first in range(len(frame))
                    for last in range(first + 2, len(frame) - 1)
                )

    feed(Mutator([f + crc(f) for f in frames], 6), FRAMED // 10 if slow else 150, read)
