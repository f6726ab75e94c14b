"""Newport driver: another device on the port is refused."""

from __future__ import annotations

import pytest

from drivers.lines.serial_line import Line
from drivers.stages.newport import NewportStage
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from sim.emulated.wire import PtyWire
from tests.support.stages.emulated_stages import LIMITS

pytestmark = pytest.mark.waits


class Parrot:
    """Gives the same answer to everything."""

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
def test_another_device_is_refused_and_its_answer_quoted(words: bytes, says: str) -> None:
    with PtyWire([Parrot(words)]) as wire, Line("theta_r", wire.port, 57600, SystemClock()) as line:
        with pytest.raises(DeviceError) as refused:
            NewportStage("theta_r", line, 1, "SMC100", LIMITS, SystemClock())
        assert says in str(refused.value)
        assert str(wire.port) in str(refused.value)
