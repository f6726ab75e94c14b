"""Zaber driver: the position after a move is one at rest."""

from __future__ import annotations

import pytest

from drivers.lines.serial_line import Line
from drivers.stages.zaber import ZaberStage
from instrument.clock import SystemClock
from sim.emulated.motor import Motor
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from tests.support.stages.emulated_stages import LIMITS, SLOW

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
