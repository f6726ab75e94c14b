"""Axis: limits of the rig file, and the check of the position after a move."""

from __future__ import annotations

from dataclasses import replace

import pytest

from acquisition.engine.axis import Axis
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import DeviceError
from instrument.record.record import Record
from tests.support.stand_ins import PassThrough
from tests.support.whole_scans.stopped_scan import scan


class Slipping(PassThrough):
    """A stage that ends each move 0.3 degrees off."""

    def wait(self) -> float:
        return float(self._device.wait()) + 0.3  # type: ignore[attr-defined]  # a stage


def test_an_axis_that_misses_its_target_ends_the_scan(small: Loaded, record: Record) -> None:
    devices = open_devices(small)
    stage = Slipping(devices.axes["theta_r"]._stage)
    axis = Axis("theta_r", stage, small.rig.axes.theta_r, devices.clock)  # type: ignore[arg-type]  # a stand-in
    axes = devices.axes | {"theta_r": axis}
    with pytest.raises(DeviceError, match=r"theta_r: stands at .*3 deg instead of 10 deg"):
        scan(small, record, changed_devices=lambda _: replace(devices, axes=axes))
    assert not record.readings()


def test_nothing_is_sent_beyond_a_limit_of_the_rig_file(small: Loaded) -> None:
    axis = open_devices(small).axes["theta_r"]
    with pytest.raises(DeviceError, match=r"theta_r: 89 deg is outside the rig's limits, -88 to"):
        axis.start_move(89.0)
