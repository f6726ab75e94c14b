"""Faults of real drivers' lines and motors within a scan: recovery or a named stop.

theta_r is a real driver over an emulated controller, in real time; the simulated camera sees where
its motor truly stands. Whatever fails, and in whichever state of the engine: each accepted reading
is that of the scan in which nothing failed, and its frames were taken where they should have been.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
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
from tests.support import faulty_scan
from tests.support.faulty_scan import Ended, Watching, require_named
from tests.support.scans import changed, small_scan
from tests.support.stages.emulated_stages import EMULATED_STAGES, EmulatedStage

pytestmark = pytest.mark.waits

DEADLINE_S = 5.0
WITHIN_DEG = 0.01  # the stages' own tolerance in `benches`
PUSH_DEG = 0.4
UNHEARD = "no status for 0.5 s while it moved"

# In each state: at or after which call of which device; of moves the second.
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
Strike = Callable[[EmulatedStage], None]


def once(fault: Fault) -> Strike:
    return lambda bench: bench.wire.inject(fault)


def for_good(fault: Fault) -> Strike:
    return lambda bench: bench.wire.inject(*[fault] * 2000)


RECOVERS: dict[str, Strike] = {
    "drop": once(Fault("drop")),
    "delay": once(Fault("delay", 0.1)),
    "late": once(Fault("late", 0.4)),
    "garbage": once(Fault("garbage")),
    "truncate": once(Fault("truncate")),
    "nul": once(Fault("nul")),
    "lose request": once(Fault("lose request")),
}
STOPS: dict[str, tuple[Strike, str]] = {
    "drop for good": (for_good(Fault("drop")), "no answer|not answer"),
    "late for good": (for_good(Fault("late", 0.3)), "answer"),
    "garbage for good": (for_good(Fault("garbage")), "answer|only"),
    "truncate for good": (for_good(Fault("truncate")), "answer|only"),
    "requests lost for good": (for_good(Fault("lose request")), "no answer|not answer"),
    "unplug": (once(Fault("unplug")), "is gone|cannot open|lost|answer"),
    "alarm": (lambda bench: bench.motor.fail(bench.alarm), "."),
    "limit switch": (
        lambda bench: bench.motor.fail(AT_LIMIT[bench.alarm]), "limit|overtravel|end of run",
    ),
}  # fmt: skip
AT_LIMIT = {"0020": "0001", "FS": "FE", "30": "66"}  # by the code of another of its faults
# What the engine does next may set these right: then nothing is heard of them.
MOTOR: dict[str, Strike] = {
    "stall": lambda bench: bench.motor.hold(),
    "push": lambda bench: bench.motor.push(PUSH_DEG),
    "power lost": lambda bench: bench.motor.lose_power(),
}
SET_RIGHT = {
    "stall": ("idle", "homing"),  # nothing holds it while it looks for its reference
    "push": ("idle", "homing", "setting out"),
    "power lost": ("idle", "homing"),
}
EVERY: dict[str, Strike] = {**RECOVERS, **{k: v for k, (v, _) in STOPS.items()}, **MOTOR}


@dataclass
class Witness:
    """The camera: has the scene stand as the motor does, and remembers where it stood."""

    camera: object
    bench: EmulatedStage
    scene: Scene
    stood_deg: dict[int, list[float]] = field(default_factory=lambda: defaultdict(list))

    def grab(self, count: int) -> list[Frame]:
        self._look()
        frames: list[Frame] = self.camera.grab(count)  # type: ignore[attr-defined]  # a stand-in
        self._look()
        return frames

    def _look(self) -> None:
        at_deg = self.bench.motor.position_deg
        self.stood_deg[self.scene.step].append(at_deg)
        self.scene.set_axis("theta_r", at_deg)

    def __getattr__(self, name: str) -> object:
        return getattr(self.camera, name)


@pytest.fixture(scope="module")
def short() -> Loaded:
    """Three points, nothing else; theta_r settles for 20 ms."""
    small = small_scan()
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 40.0]}
    theta_r = small.rig.axes.theta_r.model_copy(update={"settle_s": 0.02, "zero_deg": 0.0})
    axes = small.rig.axes.model_copy(update={"theta_r": theta_r})
    return changed(small, rig={"axes": axes}, sweeps=[sweep], references=References())


def devices_of(loaded: Loaded, bench: EmulatedStage, triggers: Triggers) -> tuple[Devices, Witness]:
    faults = Faults()
    devices = open_devices(loaded, faults)
    assert faults.scene is not None
    stage = Watching("theta_r", bench.stage, triggers)
    axis = Axis("theta_r", stage, loaded.rig.axes.theta_r, SystemClock())  # type: ignore[arg-type]  # passes all on
    witness = Witness(devices.camera, bench, faults.scene)
    camera = Watching("camera", witness, triggers)
    axes = {**devices.axes, "theta_r": axis}
    return replace(devices, axes=axes, camera=camera), witness  # type: ignore[arg-type]  # passes all on


def scan(loaded: Loaded, bench: EmulatedStage, folder: Path, triggers: Triggers) -> Ended:
    """Run, or go on; each accepted reading was taken where it should be."""
    devices, witness = devices_of(loaded, bench, triggers)
    ended = faulty_scan.scan(loaded, folder, lambda: devices, triggers)
    for reading in ended.readings[ended.before :]:
        stood_deg = witness.stood_deg[reading.step]
        assert stood_deg
        assert max(abs(at_deg - reading.theta_r_deg) for at_deg in stood_deg) <= WITHIN_DEG
    return ended


def whole_scan(loaded: Loaded, bench: EmulatedStage, folder: Path) -> list[Reading]:
    """Run or go on to the end; on a busy machine the emulated controller itself may be too late."""
    for last in (False, False, True):
        ended = scan(loaded, bench, folder, Triggers())
        if ended.error is None or last:
            break
        assert UNHEARD in str(ended.error)
    assert ended.error is None
    return ended.readings


@pytest.fixture(scope="module")
def sound(
    short: Loaded, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], list[Reading]]:
    """The readings of a scan with a controller in which nothing failed."""
    known: dict[str, list[Reading]] = {}

    def readings(kind: str) -> list[Reading]:
        if kind not in known:
            folder = tmp_path_factory.mktemp("sound") / "run"
            with EMULATED_STAGES[kind]() as bench:
                known[kind] = whole_scan(short, bench, folder)
        return known[kind]

    return readings


def cases() -> Iterator[tuple[str, str]]:
    yield from ((bench, state) for bench in EMULATED_STAGES for state in STATES)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "state"), list(cases()))
def test_a_fault_in_a_state(
    short: Loaded,
    sound: Callable[[str], list[Reading]],
    tmp_path: Path,
    kind: str,
    state: str,
    slow: bool,
) -> None:
    """All faults, or in the bounded form two that differ from case to case."""
    number = list(cases()).index((kind, state))
    names = list(EVERY)
    chosen = names if slow else [names[(2 * number + n) % len(names)] for n in (0, 1)]
    for name in chosen:
        triggers, folder = Triggers(), tmp_path / name
        with EMULATED_STAGES[kind]() as bench:
            triggers.plan(*STATES[state], partial(EVERY[name], bench))
            ended = scan(short, bench, folder, triggers)
            assert ended.readings == sound(kind)[: len(ended.readings)]
            if ended.error is None:
                assert triggers.pending == 0
                require_got_over(ended, name, state)
            else:
                require_stopped(ended, bench, name, state, folder)
                other = EMULATED_STAGES[kind]() if name == "unplug" else seen_to(bench)
                with other as again:
                    assert whole_scan(short, again, folder) == sound(kind)


def require_got_over(ended: Ended, name: str, state: str) -> None:
    assert name in RECOVERS or state in SET_RIGHT[name]
    if name in RECOVERS and name not in ("delay", "nul"):  # these are within what is heard
        assert ended.events["retry"]


def require_stopped(
    ended: Ended, bench: EmulatedStage, name: str, state: str, folder: Path
) -> None:
    """Named; of what is mostly got over, it is too late an answer that ends the scan."""
    says = STOPS[name][1] if name in STOPS else "stall|stands|homed|reference"
    if name in RECOVERS or state in SET_RIGHT.get(name, ()):
        says = UNHEARD
    message = rf"theta_r.*({says}|{UNHEARD})(.|\n)*(look (at|for)|home it|by hand)"
    require_named(ended, DeviceError, message, folder)
    require_still(bench)


def require_still(bench: EmulatedStage) -> None:
    """A stop that is on its way is soon heard; a move that no stop can reach ends by itself."""
    end_s = time.monotonic() + DEADLINE_S
    while bench.motor.moving:
        assert time.monotonic() < end_s
        time.sleep(0.005)


@contextmanager
def seen_to(bench: EmulatedStage) -> Iterator[EmulatedStage]:
    """The same controller, put right and asked anew."""
    bench.wire.clear_faults()
    bench.motor.alarm = ""
    bench.motor.stop()
    bench.stage.close()
    stage = bench.reopen()
    yield replace(bench, stage=stage)
    stage.close()
