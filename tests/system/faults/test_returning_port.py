"""Scan whose axis loses its port in a move: stopped over the port that comes back, then resumed."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from drivers.lines.serial_line import REOPEN_EVERY_S
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.devices import Camera, Frame
from instrument.errors import DeviceError
from instrument.record.record import Record
from sim.emulated.motor import Motor
from sim.faults.faults import Faults
from sim.scene.scene import Scene
from tests.support.scans import changed, small_scan
from tests.support.stages.emulated_stages import LIMITS, SLOW
from tests.support.stages.kinds import controller_for, open_stage
from tests.support.stages.plug import EventfulClock, Plug
from tests.support.stages.waiting import wait_until
from tests.support.stand_ins import PassThrough
from tests.support.whole_scans.stopped_scan import scan

pytestmark = pytest.mark.waits

MECHANICS = replace(SLOW, speed_deg_per_s=60.0, acceleration_deg_per_s2=1200.0)
LIMITS_OF_IT = replace(LIMITS, speed_deg_per_s=60.0, acceleration_deg_per_s2=1200.0)


class PulledOut:
    """theta_r behind a plug, which is pulled out in its first long move and put in for the stop."""

    def __init__(self, kind: str, link: Path, loaded: Loaded) -> None:
        self.clock = EventfulClock(REOPEN_EVERY_S)
        self.motor = Motor(MECHANICS, self.clock)
        controller, _ = controller_for(kind, self.motor, self.clock)
        self.plug = Plug(link, controller)
        self.clock.then = self.plug.put_in
        self.stage = open_stage(kind, str(link), LIMITS_OF_IT, self.clock)
        self.axis = Axis("theta_r", self.stage, loaded.rig.axes.theta_r, self.clock)

    def pull_out(self) -> None:
        wait_until(lambda: abs(self.motor.position_deg) > 3.0 and self.motor.moving)
        self.plug.pull_out()

    def devices(self, loaded: Loaded) -> Devices:
        """Simulated devices but for theta_r; the camera sees where its motor is."""
        faults = Faults()
        devices = open_devices(loaded, faults)
        assert faults.scene is not None
        camera = Aimed(devices.camera, self.motor, faults.scene)
        return replace(devices, axes={**devices.axes, "theta_r": self.axis}, camera=camera)  # type: ignore[arg-type]  # a stand-in


class Aimed(PassThrough):
    """Camera of a scene in which theta_r is where its motor is."""

    def __init__(self, camera: Camera, motor: Motor, scene: Scene) -> None:
        super().__init__(camera)
        self._camera, self._motor, self._scene = camera, motor, scene

    def grab(self, count: int) -> list[Frame]:
        self._scene.set_axis("theta_r", self._motor.position_deg)
        return self._camera.grab(count)


def test_the_axis_is_stopped_and_the_scan_resumed_in_the_same_process(tmp_path: Path) -> None:
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-70.0, 0.0]}
    loaded = changed(small_scan(), sweeps=[sweep], references=References())
    rig = PulledOut("newport", tmp_path / "usb-adapter", loaded)
    pulling = threading.Thread(target=rig.pull_out)
    pulling.start()
    with Record.create(tmp_path / "run", {}) as record:
        with pytest.raises(DeviceError, match=r"theta_r.*is gone"):
            scan(loaded, record, changed_devices=lambda _: rig.devices(loaded))
        pulling.join(timeout=5)
        wait_until(lambda: not rig.motor.moving)
        assert 3.0 < abs(rig.motor.position_deg) < 69.0  # it did not run on to its end
        scan(loaded, record, changed_devices=lambda _: rig.devices(loaded))
        assert {r.theta_r_deg for r in record.readings() if r.kind == "point"} == {-70.0, 0.0}
    rig.stage.close()
    rig.plug.pull_out()
