"""Faults of lines and motors under the real drivers while theta_r turns: a clear stop, or recovery.

theta_r is a real driver over an emulated controller, and the simulated camera exposes in real time
along the true motion of the motor. Whatever fails on the way, the angle of each accepted reading is
one at which the motor was during its frame, and a resume completes the scan.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from instrument.clock import SystemClock
from instrument.config.load import Loaded
from instrument.config.protocol import FlyConfig, References, Steps
from instrument.devices import Frame
from instrument.errors import DeviceError
from sim.emulated.wire import Fault
from sim.faults.faults import Faults
from sim.faults.triggers import Triggers
from sim.scene.camera import SimulatedCamera
from sim.scene.scene import Scene
from tests.support.flights.fly_scans import fly_scan
from tests.support.scans import changed
from tests.support.stages.emulated_stages import EMULATED_STAGES, EmulatedStage, repaired
from tests.support.whole_scans import faulty_scan
from tests.support.whole_scans.faulty_scan import ScanResult, WatchedDevice, require_reported

pytestmark = pytest.mark.waits

ANGLES = 12
FIRST_GRAB = 1 + ANGLES  # in the turns there and back, or later, in the one that counts
AWAY_DEG = 0.5  # of a time stamp on a busy machine, at 60 deg/s
MakeFail = Callable[[EmulatedStage], None]
FAULTS: dict[str, MakeFail] = {
    "one answer lost": lambda emulated: emulated.wire.inject(Fault("drop")),
    "one answer spoilt": lambda emulated: emulated.wire.inject(Fault("garbage")),
    "no more answers": lambda emulated: emulated.wire.inject(*[Fault("drop")] * 2000),
    "unplugged": lambda emulated: emulated.wire.inject(Fault("unplug")),
    "alarm": lambda emulated: emulated.motor.fail(emulated.kind.alarm),
    "limit switch": lambda emulated: emulated.motor.fail(emulated.kind.at_limit),
    "stall": lambda emulated: emulated.motor.hold(),
    "power lost": lambda emulated: emulated.motor.lose_power(),
    "stopped by somebody": lambda emulated: emulated.motor.stop(),
}
RECOVERS = {"one answer lost", "one answer spoilt"}


@dataclass
class RealTimeCamera:
    """Simulated camera in real time; it exposes along the motion of a motor, and remembers it."""

    camera: SimulatedCamera
    emulated: EmulatedStage
    scene: Scene
    ranges_deg: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))

    def grab(self, count: int) -> list[Frame]:
        own = self.ranges_deg[self.scene.step]
        own[:] = [self._moved_deg()]
        frames = self.camera.grab(count)
        own.append(self._moved_deg())
        return frames

    def _moved_deg(self) -> float:
        motor = self.emulated.motor
        at_deg, motion = motor.position_deg, motor.motion()
        self.scene.set_axis("theta_r", at_deg)
        self.scene.motions.pop("theta_r", None)
        if motion is not None:
            self.scene.motions["theta_r"] = motion
        return at_deg

    def __getattr__(self, name: str) -> object:
        return getattr(self.camera, name)


@pytest.fixture(scope="module")
def short() -> Loaded:
    """One sweep, at some 60 deg/s."""
    loaded = fly_scan(shrink=16)
    update = {
        "settle_s": 0.0, "zero_deg": 0.0, "u_deg": 0.0, "speed_deg_per_s": 60.0,
        "acceleration_deg_per_s2": 1000.0,
    }  # fmt: skip
    theta_r = loaded.rig.axes.theta_r.model_copy(update=update)
    sweep = {
        "theta_i_deg": [30.0],
        "dphi_deg": [0.0],
        "theta_r_deg": Steps(start=-70.0, stop=0.0, num=ANGLES),
    }
    axes = loaded.rig.axes.model_copy(update={"theta_r": theta_r})
    fly = FlyConfig(narrowest_lobe_deg=90.0)
    return changed(loaded, rig={"axes": axes}, sweeps=[sweep], references=References(), fly=fly)


def devices_of(
    loaded: Loaded, emulated: EmulatedStage, triggers: Triggers
) -> tuple[Devices, RealTimeCamera]:
    faults, clock = Faults(), SystemClock()
    devices = open_devices(loaded, faults)
    scene = faults.scene
    assert scene is not None
    scene.use_clock(clock)
    stage = WatchedDevice("theta_r", emulated.stage, triggers)
    axis = Axis("theta_r", stage, loaded.rig.axes.theta_r, clock)  # type: ignore[arg-type]  # forwards everything
    witness = RealTimeCamera(SimulatedCamera(scene, clock), emulated, scene)
    camera = WatchedDevice("camera", witness, triggers)
    axes = {**devices.axes, "theta_r": axis}
    return replace(devices, axes=axes, camera=camera, clock=clock), witness  # type: ignore[arg-type]  # forwards everything


def scan(loaded: Loaded, emulated: EmulatedStage, folder: Path, triggers: Triggers) -> ScanResult:
    """Run or resume a scan; each new reading was taken where it says."""
    devices, witness = devices_of(loaded, emulated, triggers)
    result = faulty_scan.scan(loaded, folder, lambda: devices, triggers)
    for reading in result.readings[result.before :]:
        low, high = sorted(witness.ranges_deg[reading.step])
        assert low - AWAY_DEG < reading.theta_r_deg < high + AWAY_DEG
    return result


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(EMULATED_STAGES))
def test_a_fault_on_the_way(short: Loaded, tmp_path: Path, kind: str, slow: bool) -> None:
    """One fault for each kind of controller, another in each; with --slow all."""
    names = list(FAULTS)
    number = list(EMULATED_STAGES).index(kind)
    for place, name in enumerate(names if slow else [names[2 * number + 1]]):
        triggers, folder = Triggers(), tmp_path / name
        with EMULATED_STAGES[kind]() as emulated:
            grab = FIRST_GRAB + 12 * (place % 3)
            triggers.plan("after", "camera.grab", grab, lambda n=name, e=emulated: FAULTS[n](e))  # type: ignore[misc]  # bound now
            result = scan(short, emulated, folder, triggers)
            assert triggers.pending == 0
            if result.error is None:
                assert name in RECOVERS
                assert len(result.readings) == ANGLES
                continue
            require_reported(result, DeviceError, "theta_r", folder)
            other = EMULATED_STAGES[kind]() if name == "unplugged" else repaired(emulated)
            with other as again:
                last = scan(short, again, folder, Triggers())
                assert last.error is None
                assert [r.step for r in last.readings] == list(range(ANGLES))
