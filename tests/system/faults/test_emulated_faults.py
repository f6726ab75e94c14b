"""Faults of lines and motors under the real drivers during a scan: recovery or a clear stop.

theta_r is a real driver over an emulated controller, in real time; the simulated camera sees the
true motor position. Whatever fails, in any state of the engine, each accepted reading equals that
of the undisturbed scan, and its frames were taken at the right position.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import pytest

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from instrument.clock import SystemClock
from instrument.config.load import Loaded
from instrument.config.protocol import References
from instrument.devices import Frame
from instrument.errors import DeviceError
from instrument.record.reading import Reading
from sim.emulated.wire import Fault
from sim.faults.faults import Faults
from sim.faults.triggers import Triggers, When
from sim.scene.scene import Scene
from tests.support.scans import changed, small_scan
from tests.support.stages.emulated_stages import EMULATED_STAGES, EmulatedStage, repaired
from tests.support.whole_scans import faulty_scan
from tests.support.whole_scans.faulty_scan import ScanResult, WatchedDevice, require_reported

pytestmark = pytest.mark.waits

DEADLINE_S = 5.0
WITHIN_DEG = 0.01  # the stages' tolerance in `emulated_stages`
PUSH_DEG = 0.4
STATUS_LATE = "while it moved, so it was told to stop"  # no status, or the computer paused

# A trigger in each state; for moves the second one.
STATES: dict[str, tuple[When, str, int]] = {
    "idle": ("at", "theta_r.identity", 1),
    "homing": ("at", "theta_r.home", 1),
    "setting out": ("at", "theta_r.start_move", 3),
    "moving": ("after", "theta_r.start_move", 3),
    "settling": ("after", "theta_r.wait", 3),
    "exposing": ("after", "camera.grab", 3),
    "reading": ("at", "theta_r.position_deg", 2),
    "writing": ("at", "record.add_reading", 1),
}
MakeFail = Callable[[EmulatedStage], None]


def once(fault: Fault) -> MakeFail:
    return lambda emulated: emulated.wire.inject(fault)


def permanently(fault: Fault) -> MakeFail:
    return lambda emulated: emulated.wire.inject(*[fault] * 2000)


RECOVERS: dict[str, MakeFail] = {
    "drop": once(Fault("drop")),
    "delay": once(Fault("delay", 0.1)),
    "late": once(Fault("late", 0.4)),
    "garbage": once(Fault("garbage")),
    "truncate": once(Fault("truncate")),
    "nul": once(Fault("nul")),
    "lose request": once(Fault("lose request")),
}
STOPS: dict[str, tuple[MakeFail, str]] = {
    "drop permanently": (permanently(Fault("drop")), "no answer|not answer"),
    "late permanently": (permanently(Fault("late", 0.3)), "answer"),
    "garbage permanently": (permanently(Fault("garbage")), "answer|only"),
    "truncate permanently": (permanently(Fault("truncate")), "answer|only"),
    "requests lost permanently": (permanently(Fault("lose request")), "no answer|not answer"),
    "unplug": (once(Fault("unplug")), "is gone|cannot open|lost|answer"),
    "alarm": (lambda emulated: emulated.motor.fail(emulated.kind.alarm), "."),
    "limit switch": (
        lambda emulated: emulated.motor.fail(emulated.kind.at_limit),
        "limit|overtravel|end of run",
    ),
}  # fmt: skip
# Faults that the engine's next action may remove without a report.
MOTOR: dict[str, MakeFail] = {
    "stall": lambda emulated: emulated.motor.hold(),
    "push": lambda emulated: emulated.motor.push(PUSH_DEG),
    "power lost": lambda emulated: emulated.motor.lose_power(),
}
REMOVED = {
    "stall": ("idle", "homing"),  # homing releases the axis
    "push": ("idle", "homing", "setting out"),
    "power lost": ("idle", "homing"),
}
EVERY: dict[str, MakeFail] = {**RECOVERS, **{k: v for k, (v, _) in STOPS.items()}, **MOTOR}


@dataclass
class Witness:
    """Camera that sets the scene to the motor's true position and remembers it for each step."""

    camera: object
    emulated: EmulatedStage
    scene: Scene
    positions_deg: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))

    def grab(self, count: int) -> list[Frame]:
        self._note_position()
        frames: list[Frame] = self.camera.grab(count)  # type: ignore[attr-defined]  # a stand-in
        self._note_position()
        return frames

    def _note_position(self) -> None:
        at_deg = self.emulated.motor.position_deg
        self.positions_deg[self.scene.step].append(at_deg)
        self.scene.set_axis("theta_r", at_deg)

    def __getattr__(self, name: str) -> object:
        return getattr(self.camera, name)


@pytest.fixture(scope="module")
def short() -> Loaded:
    """A scan of three points only; theta_r settles for 20 ms."""
    small = small_scan()
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 40.0]}
    theta_r = small.rig.axes.theta_r.model_copy(update={"settle_s": 0.02, "zero_deg": 0.0})
    axes = small.rig.axes.model_copy(update={"theta_r": theta_r})
    return changed(small, rig={"axes": axes}, sweeps=[sweep], references=References())


def devices_of(
    loaded: Loaded, emulated: EmulatedStage, triggers: Triggers
) -> tuple[Devices, Witness]:
    faults = Faults()
    devices = open_devices(loaded, faults)
    assert faults.scene is not None
    stage = WatchedDevice("theta_r", emulated.stage, triggers)
    axis = Axis("theta_r", stage, loaded.rig.axes.theta_r, SystemClock())  # type: ignore[arg-type]  # forwards everything
    witness = Witness(devices.camera, emulated, faults.scene)
    camera = WatchedDevice("camera", witness, triggers)
    axes = {**devices.axes, "theta_r": axis}
    return replace(devices, axes=axes, camera=camera), witness  # type: ignore[arg-type]  # forwards everything


def scan(loaded: Loaded, emulated: EmulatedStage, folder: Path, triggers: Triggers) -> ScanResult:
    """Run or resume a scan; each new reading must have been taken at the right position."""
    devices, witness = devices_of(loaded, emulated, triggers)
    result = faulty_scan.scan(loaded, folder, lambda: devices, triggers)
    for reading in result.readings[result.before :]:
        positions_deg = witness.positions_deg[reading.step]
        assert positions_deg
        assert max(abs(at_deg - reading.theta_r_deg) for at_deg in positions_deg) <= WITHIN_DEG
    return result


def complete_scan(loaded: Loaded, emulated: EmulatedStage, folder: Path) -> list[Reading]:
    """Run or resume to the end; on a busy machine the emulated controller may answer too late."""
    for last in (False, False, True):
        result = scan(loaded, emulated, folder, Triggers())
        if result.error is None or last:
            break
        assert STATUS_LATE in str(result.error)
    assert result.error is None
    return result.readings


@pytest.fixture(scope="module")
def sound(
    short: Loaded, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], list[Reading]]:
    """Readings of the undisturbed scan with each controller."""
    cache: dict[str, list[Reading]] = {}

    def readings(kind: str) -> list[Reading]:
        if kind not in cache:
            folder = tmp_path_factory.mktemp("sound") / "run"
            with EMULATED_STAGES[kind]() as emulated:
                cache[kind] = complete_scan(short, emulated, folder)
        return cache[kind]

    return readings


def cases() -> Iterator[tuple[str, str]]:
    yield from ((kind, state) for kind in EMULATED_STAGES for state in STATES)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "state"), list(cases()))
def test_a_fault_in_each_state(
    short: Loaded,
    sound: Callable[[str], list[Reading]],
    tmp_path: Path,
    kind: str,
    state: str,
    slow: bool,
) -> None:
    """One fault, another in each case until each has been met; with --slow all."""
    number = list(cases()).index((kind, state))
    names = list(EVERY)
    chosen = names if slow else [names[number % len(names)]]
    for name in chosen:
        triggers, folder = Triggers(), tmp_path / name
        with EMULATED_STAGES[kind]() as emulated:
            triggers.plan(*STATES[state], partial(EVERY[name], emulated))
            result = scan(short, emulated, folder, triggers)
            assert result.readings == sound(kind)[: len(result.readings)]
            if result.error is None:
                assert triggers.pending == 0
                require_recovered(result, name, state)
            else:
                require_stopped(result, emulated, name, state, folder)
                other = EMULATED_STAGES[kind]() if name == "unplug" else repaired(emulated)
                with other as again:
                    assert complete_scan(short, again, folder) == sound(kind)


def require_recovered(result: ScanResult, name: str, state: str) -> None:
    assert name in RECOVERS or state in REMOVED[name]
    if name in RECOVERS and name not in ("delay", "nul"):  # these answers still arrive in time
        assert result.events["retry"]


def require_stopped(
    result: ScanResult, emulated: EmulatedStage, name: str, state: str, folder: Path
) -> None:
    """A recoverable fault may end the scan only because an answer came too late."""
    cause = STOPS[name][1] if name in STOPS else "stall|stands|homed|reference"
    if name in RECOVERS or state in REMOVED.get(name, ()):
        cause = STATUS_LATE
    message = (
        rf"theta_r.*({cause}|{STATUS_LATE})(.|\n)*(look (at|for)|check|find out|home it|by hand)"
    )
    require_reported(result, DeviceError, message, folder)
    require_still(emulated)


def require_still(emulated: EmulatedStage) -> None:
    """The axis comes to rest: by the stop, or by the end of the move if no stop can reach it."""
    end_s = time.monotonic() + DEADLINE_S
    while emulated.motor.moving:
        assert time.monotonic() < end_s
        time.sleep(0.005)
