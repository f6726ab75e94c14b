"""Motors of ophyd-async for tests: fast, in degrees, in real time."""

from __future__ import annotations

from ophyd_async.core import soft_signal_rw
from ophyd_async.sim import SimMotor


class FastMotor(SimMotor):
    """Rotary motor that ramps up in 10 ms; `prefix` is its name only."""

    def __init__(self, prefix: str = "") -> None:
        super().__init__(prefix, instant=False, units="deg")
        self.acceleration_time = soft_signal_rw(float, 0.01)


class LinearMotor(SimMotor):
    """Motor that counts in mm."""
