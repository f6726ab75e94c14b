"""Faults of the world in the middle of scans, and what became of the points.

Each scan is compared with a sound one with the same noise. After a stop it is resumed with the
world in order again, as a person would who has read the message.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acquisition.results.reduction import Reduced, reduced_run, root_sum_square
from acquisition.rig import open_devices
from analysis.models import MODELS
from instrument.config.load import Loaded
from instrument.errors import GonioError
from instrument.geometry import FloatArray, Geometry
from instrument.record.reading import Reading
from instrument.record.record import Record
from sim.defects.world import SOUND
from sim.faults.faults import Faults
from sim.faults.triggers import When
from tests.support.whole_scans import faulty_scan
from tests.support.whole_scans.faulty_scan import ScanResult

LIMIT_U = 3.0  # farther from the sound scan's value, a point must be flagged

Change = tuple[str, str, When, str, int]  # fault, value, and the call at which it begins
Course = Callable[["Attack", str, "Sound", np.random.Generator], list[Change]]


@dataclass(frozen=True, slots=True)
class Sound:
    """Scan of a sound world: its calls of devices, its values by step, and what it flagged."""

    calls: tuple[str, ...]
    kinds: tuple[str, ...]  # of the readings, in the order of time
    blocks: tuple[int, ...]
    values: dict[int, float]
    flagged: dict[int, str]

    @property
    def tiles(self) -> int:
        """Number of readings of the tile before the first one of the sample."""
        return next(n for n, kind in enumerate(self.kinds) if kind != "tile")

    def proven(self) -> list[int]:
        """Numbers of the calls of grab between two drift checks of one block."""
        found = list[int]()
        for block in set(self.blocks):
            checks = [
                n
                for n, (kind, own) in enumerate(zip(self.kinds, self.blocks, strict=True), 1)
                if kind == "drift" and own == block
            ]
            found += range(self.grab_after(checks[0]), self.grab_after(checks[-1] - 1) + 1)
        return found

    def grabs(self) -> int:
        """Number of calls of the camera's grab."""
        return self.calls.count("camera.grab")

    def grab_after(self, reading: int) -> int:
        """Number of the first call of grab after a reading is on disk, or the last of all."""
        at = [n for n, call in enumerate(self.calls) if call == "record.add_reading"][reading - 1]
        return min(self.calls[:at].count("camera.grab") + 1, self.grabs())


@dataclass(frozen=True, slots=True)
class Attack:
    """Fault of the world at two sizes. `seen_by`: the interlock that must notice it."""

    name: str
    fault: str
    sizes: tuple[str, str]
    course: Course
    seen_by: str
    rigs: tuple[str, ...] = ()  # the only ones on which it can happen; all if empty


@dataclass(slots=True)
class Outcome:
    """What became of an attacked scan.

    `stop`: the message with which it ended early, or empty. `off`: deviations in u of the points
    that are neither within the limit nor flagged, by step; `off_resumed`: of the resumed scan.
    """

    stop: str = ""
    flags: dict[int, str] = field(default_factory=dict)
    off: dict[int, float] = field(default_factory=dict)
    off_resumed: dict[int, float] = field(default_factory=dict)
    again: str = ""

    @property
    def silent(self) -> bool:
        """True if wrong points came without a flag and with exit code 0."""
        return (bool(self.off) and not self.stop) or bool(self.off_resumed)

    @property
    def word(self) -> str:
        """One word of a table."""
        if self.silent:
            worst = max(map(abs, [*self.off.values(), *self.off_resumed.values()]))
            return f"SILENT{' AFTER RESUME' if self.off_resumed else ''} {worst:.0f} u"
        return "stopped" if self.stop else "flagged" if self.flags else "harmless"


def stays(attack: Attack, size: str, sound: Sound, random: np.random.Generator) -> list[Change]:
    """From any picture between two drift checks on."""
    return [(attack.fault, size, "at", "camera.grab", int(random.choice(sound.proven())))]


def always(attack: Attack, size: str, sound: Sound, random: np.random.Generator) -> list[Change]:
    """From the first picture on."""
    return [(attack.fault, size, "at", "camera.grab", 1)]


def after_tile(
    attack: Attack, size: str, sound: Sound, random: np.random.Generator
) -> list[Change]:
    """From the first picture of the sample on."""
    return [(attack.fault, size, "at", "camera.grab", sound.grab_after(sound.tiles))]


def on_tile(attack: Attack, size: str, sound: Sound, random: np.random.Generator) -> list[Change]:
    """As long as the tile is measured first."""
    first = sound.grab_after(sound.tiles)
    return [(attack.fault, size, "at", "camera.grab", 1), back(attack, first)]


def passes(attack: Attack, size: str, sound: Sound, random: np.random.Generator) -> list[Change]:
    """During one to ten series of pictures."""
    first = int(random.choice(sound.proven()))
    last = first + int(random.integers(1, 11))
    return [(attack.fault, size, "at", "camera.grab", first), back(attack, last)]


def grows(attack: Attack, size: str, sound: Sound, random: np.random.Generator) -> list[Change]:
    """From any picture between two drift checks on, to the full size at the end of the scan."""
    start, end = float(getattr(SOUND, attack.fault)), float(size)
    first = int(random.choice(sound.proven()))
    steps = np.unique(np.linspace(first, sound.grabs(), 20).astype(int))
    levels = np.linspace(start, end, steps.size + 1)[1:]
    return [
        (attack.fault, f"{level:.6g}", "at", "camera.grab", int(n))
        for n, level in zip(steps, levels, strict=True)
    ]


def back(attack: Attack, grab: int) -> Change:
    """End of a fault at a call of grab."""
    return (attack.fault, str(getattr(SOUND, attack.fault)), "at", "camera.grab", grab)


def scanned(loaded: Loaded, folder: Path, faults: Faults | None = None) -> ScanResult:
    """Scan, or resume the scan in the folder, with these faults."""
    own = faults or Faults()
    return faulty_scan.scan(loaded, folder, lambda: open_devices(loaded, own), own.triggers)


def planned(changes: Sequence[Change]) -> Faults:
    """Return the faults of a world that changes."""
    faults = Faults()
    for fault, value, when, call, number in changes:
        faults.plan_world(fault, value, when, call, number)
    return faults


def sound_scan(loaded: Loaded, folder: Path) -> Sound:
    """Scan in a sound world."""
    faults = Faults()
    result = scanned(loaded, folder, faults)
    if result.error is not None:
        raise result.error
    reduced = reduced_scan(loaded, folder)
    readings = sorted(result.readings, key=lambda r: r.time_s)
    return Sound(
        tuple(faults.triggers.calls),
        tuple(r.kind for r in readings),
        tuple(r.block for r in readings),
        {p.step: float(v) for p, v in zip(reduced.points, reduced.brdf, strict=True)},
        {p.step: f for p, f in zip(reduced.points, reduced.flags, strict=True) if f},
    )


def attacked(
    loaded: Loaded, folder: Path, sound: Sound, changes: Sequence[Change], at_resume: int = 0
) -> Outcome:
    """Scan in a world that changes; after a stop, resume the scan in a sound one.

    `at_resume`: call of grab at which the sound scan is stopped, to be resumed in that world; 0
    for none.
    """
    if at_resume:
        _stopped(loaded, folder, at_resume)
    result = scanned(loaded, folder, planned(changes))
    outcome = Outcome(stop=_cause(result.error))
    outcome.flags, outcome.off = _compared(loaded, folder, sound)
    if result.error is not None and "Go on with: gonio resume" in str(result.error):
        resumed = scanned(loaded, folder)
        outcome.again = _cause(resumed.error)
        if resumed.error is None:
            outcome.off_resumed = _compared(loaded, folder, sound)[1]
    return outcome


def _stopped(loaded: Loaded, folder: Path, grab: int) -> None:
    scanned(loaded, folder, Faults(f"camera is unplugged at camera.grab {grab}"))


def _cause(error: GonioError | None) -> str:
    return "" if error is None else f"{type(error).__name__}: {str(error).splitlines()[0]}"


def reduced_scan(loaded: Loaded, folder: Path) -> Reduced:
    """Values of the scan in a folder."""
    with Record.open(folder) as record:
        return reduced_run(record, loaded)


def _compared(
    loaded: Loaded, folder: Path, sound: Sound
) -> tuple[dict[int, str], dict[int, float]]:
    """Flags that a sound scan does not raise, and deviations beyond the limit, by step."""
    reduced = reduced_scan(loaded, folder)
    flags = {
        p.step: f
        for p, f in zip(reduced.points, reduced.flags, strict=True)
        if f and f != sound.flagged.get(p.step)
    }
    steps = [p.step for p, valid in zip(reduced.points, reduced.valid, strict=True) if valid]
    if not steps:
        return flags, {}
    brdf, u = _values(reduced, loaded)
    deviations = (brdf - np.array([sound.values[step] for step in steps])) / u
    return flags, {
        step: float(d) for step, d in zip(steps, deviations, strict=True) if not abs(d) <= LIMIT_U
    }


def _values(reduced: Reduced, loaded: Loaded) -> tuple[FloatArray, FloatArray]:
    """BRDF of the valid points and their u in 1/sr, (N,) each, as measurements.csv states them.

    The part from the angles follows from the true model instead of a fitted one.
    """
    valid = reduced.valid
    brdf = reduced.brdf[valid]
    points = [p for p, kept in zip(reduced.points, valid, strict=True) if kept]
    own = root_sum_square([part[valid] for part in reduced.parts.values()])
    return brdf, np.hypot(np.abs(brdf) * own, _u_by_angles(points, loaded))


def _u_by_angles(points: Sequence[Reading], loaded: Loaded) -> FloatArray:
    """Standard uncertainty of the true model's BRDF due to the angles of points, (N,) in 1/sr."""
    sample = loaded.protocol.simulated_sample
    assert sample is not None
    names = ("theta_i", "theta_r", "dphi")
    here = {name: np.array([getattr(p, f"{name}_deg") for p in points]) for name in names}

    def brdf(name: str, by_deg: float) -> FloatArray:
        angles = {**here, name: here[name] + by_deg}
        angles["theta_i"] = np.abs(angles["theta_i"])
        return MODELS[sample.model].brdf(Geometry.from_degrees(**angles), **sample.parameters)

    changes = [
        (brdf(name, u) - brdf(name, -u)) / 2 for name in names if (u := loaded.rig.axes[name].u_deg)
    ]
    return root_sum_square(changes) if changes else np.zeros(len(points))
