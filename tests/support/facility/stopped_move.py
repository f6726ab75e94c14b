"""A move that a stop from another thread ends."""

from __future__ import annotations

import threading

import pytest

from drivers.stages.motor_stage import MotorStage, Stopped


def stopped_position_deg(stage: MotorStage, to_deg: float) -> float:
    """Stop a move to an angle from another thread; return where the stage stands, in degrees."""
    stage.start_move(to_deg)
    stopper = threading.Thread(target=stage.stop)
    stopper.start()
    with pytest.raises(Stopped, match="theta_r: stopped at"):
        stage.wait()
    stopper.join(10.0)
    return stage.position_deg()
