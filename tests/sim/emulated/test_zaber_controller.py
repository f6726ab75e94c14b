"""The maker's own library drives the emulated Zaber stage: a second reader of the protocol."""

from __future__ import annotations

import pytest

from instrument.clock import SystemClock
from sim.emulated.motor import Motor
from sim.emulated.wire import PtyWire
from sim.emulated.zaber_controller import MICROSTEPS_PER_DEG, ZaberController
from tests.support.stages.emulated_stages import MECHANICS

zaber = pytest.importorskip(
    "zaber_motion.ascii", reason="zaber-motion, the maker's library, is not installed"
)
exceptions = pytest.importorskip("zaber_motion.exceptions")


def test_the_maker_s_library_drives_the_emulated_stage() -> None:
    motor = Motor(MECHANICS, SystemClock())
    with (
        PtyWire([ZaberController(motor)]) as wire,
        zaber.Connection.open_serial_port(wire.port) as connection,
    ):
        connection.checksum_enabled = True
        (device,) = connection.detect_devices(identify_devices=False)
        axis = device.get_axis(1)
        assert not axis.is_homed()
        assert axis.warnings.get_flags() == {"WH"}
        axis.home()
        assert axis.is_homed()
        axis.move_absolute(round(12.5 * MICROSTEPS_PER_DEG))
        assert motor.position_deg == pytest.approx(12.5, abs=1e-3)
        assert axis.get_position() == round(12.5 * MICROSTEPS_PER_DEG)
        axis.settings.set("maxspeed", 123456)
        assert axis.settings.get("maxspeed") == 123456


def test_it_reads_a_refusal_and_a_fault_as_such() -> None:
    motor = Motor(MECHANICS, SystemClock())
    with (
        PtyWire([ZaberController(motor)]) as wire,
        zaber.Connection.open_serial_port(wire.port) as connection,
    ):
        axis = connection.detect_devices(identify_devices=False)[0].get_axis(1)
        axis.home()
        with pytest.raises(exceptions.CommandFailedException, match="BADDATA"):
            axis.move_absolute(10**9)
        motor.fail("FS")
        assert "FS" in axis.warnings.get_flags()
