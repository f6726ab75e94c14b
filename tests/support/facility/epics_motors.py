"""EPICS motors of ophyd-async in its mock mode: signals without a record behind them.

The mock does what a motor record does (EPICS motor record, R7): a value in VAL sets DMOV to 0, RBV
follows at VELO, and DMOV is 1 again at the end; STOP ends the move wherever it is, and nothing else
does. In mock mode no transport takes part, so that neither aioca nor p4p is needed.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any
from unittest.mock import patch

from ophyd_async.core import (
    DeviceMock,
    SoftSignalBackend,
    callback_on_mock_put,
    default_mock_class,
    set_mock_units,
    set_mock_value,
)
from ophyd_async.epics.motor import Motor

LIMIT_DEG = 50.0  # of the record itself, on either side
_STEP_S = 0.002


class _RecordMock(DeviceMock["MockedMotor"]):
    """Moves the readback of a motor as its record does."""

    async def connect(self, device: MockedMotor) -> None:
        """Set what the record holds, and answer what is written to it."""
        set_mock_value(device.motor_done_move, 1)
        set_mock_units(device.user_readback, device.UNIT)
        for low in (device.low_limit_travel, device.dial_low_limit_travel):
            set_mock_value(low, -LIMIT_DEG)
        for high in (device.high_limit_travel, device.dial_high_limit_travel):
            set_mock_value(high, LIMIT_DEG)
        callback_on_mock_put(device.user_setpoint, device.follow)
        callback_on_mock_put(device.motor_stop, device.end_move)


@default_mock_class(_RecordMock)
class MockedMotor(Motor):
    """EPICS motor that is always connected in mock mode; `last`: the one made last."""

    UNIT = "deg"
    BEGINS_AFTER_S = 0.0
    last: MockedMotor

    def __init__(self, prefix: str) -> None:
        backend = "ophyd_async.epics.core._signal._epics_signal_backend"
        with patch(backend, lambda datatype, *_: SoftSignalBackend(datatype)):
            super().__init__(prefix)
        self.stops = 0
        self._stopped = asyncio.Event()
        MockedMotor.last = self

    async def connect(self, *_: Any, **__: Any) -> None:
        """Connect without a control system."""
        await super().connect(mock=True)

    async def follow(self, target_deg: float) -> None:
        """Move until the target or a stop; who no longer waits for the end does not end it."""
        self._stopped.clear()
        await asyncio.shield(asyncio.create_task(self._move(target_deg)))

    def end_move(self, value: int) -> None:
        """End a move, as a 1 in STOP does."""
        if value == 1:
            self.stops += 1
            self._stopped.set()

    async def _move(self, target_deg: float) -> None:
        await asyncio.sleep(self.BEGINS_AFTER_S)
        set_mock_value(self.motor_done_move, 0)
        start_deg, speed = await self.user_readback.get_value(), await self.velocity.get_value()
        way_deg, begun_s, share = abs(target_deg - start_deg), time.monotonic(), 0.0
        while share < 1 and not self._stopped.is_set():
            gone_deg = speed * (time.monotonic() - begun_s)
            share = min(gone_deg / way_deg, 1.0) if way_deg else 1.0
            set_mock_value(self.user_readback, start_deg + share * (target_deg - start_deg))
            await asyncio.sleep(_STEP_S)
        set_mock_value(self.motor_done_move, 1)


class LateMotor(MockedMotor):
    """Motor whose record takes a while before it says that it moves."""

    BEGINS_AFTER_S = 0.05


class LinearMotor(MockedMotor):
    """Motor that counts in mm."""

    UNIT = "mm"
