"""Scans that are killed with SIGKILL, and checks of what they leave; a process that can fork.

`FOLDER KILLS SEED` kills at random moments, `FOLDER entries STRIDE` before every STRIDE-th file
operation of the scan (under the write recorder); both print the outcome as JSON.
`FOLDER record LOG` kills nothing: the recorder logs a scan that keeps its frames and is stopped and
resumed once.
"""

from __future__ import annotations

import ctypes
import json
import os
import random
import shutil
import signal
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from io import FileIO
from itertools import pairwise
from pathlib import Path

from acquisition.engine.engine import Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.reduction import reduce
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.errors import InputError
from instrument.record.reading import Reading
from instrument.record.record import Record
from tests.support.scans import changed, shortest_scan, small_scan, undated


@dataclass
class Outcome:
    """Counts over all kills; all but the first three must stay 0."""

    kills: int = 0
    killed_twice: int = 0
    accepted_before: int = 0
    lost: int = 0
    duplicated: int = 0
    not_the_plan_s: int = 0
    unequal: int = 0
    results_unequal: int = 0
    choices_unequal: int = 0
    jumped: int = 0


def scan(folder: Path, loaded: Loaded, plan: Plan, told: Callable[[int], None]) -> None:
    """Start or resume the scan in that folder; `told` is called with each accepted step."""
    with opened(folder) as record, record.claimed():
        scan_claimed(record, loaded, plan, told)


def scan_claimed(record: Record, loaded: Loaded, plan: Plan, told: Callable[[int], None]) -> None:
    """Start or resume the scan of an open record."""
    before = Progress.of(record)
    if not plan.growing and not before.missing(plan):
        return
    devices = open_devices(loaded)
    engine = Engine(loaded.protocol, loaded.rig, devices, record, lambda step: told(step.index))
    engine.run(plan, before if before.readings else None)


def opened(folder: Path) -> Record:
    """Open the record of the run; replace one that had not begun, as its message advises."""
    if folder.exists():
        try:
            return Record.open(folder)
        except InputError as error:
            if "nothing was measured" not in str(error) and "no record.sqlite" not in str(error):
                raise
        shutil.rmtree(folder)
    return Record.create(folder, {})


class Killer:
    """Scans in forked processes that are killed."""

    def __init__(self, folder: Path, loaded: Loaded) -> None:
        self._folder = folder
        self._loaded = loaded
        at_s = list[float]()
        self.scan(folder / "whole", lambda _: at_s.append(time.monotonic()))  # fills the caches
        self.usual_step_s = statistics.median(b - a for a, b in pairwise(at_s))
        with Record.open(folder / "whole") as record:
            self._whole = measured(record)
            self._brdf = self._reduced(record)
        self.outcome = Outcome()

    @property
    def steps(self) -> int:
        """Steps of a whole scan."""
        return len(self._whole)

    def scan(self, run: Path, told: Callable[[int], None] = lambda _: None) -> None:
        """Start or resume the scan in a folder; `told` is called with each accepted step."""
        scan(run, self._loaded, make_plan(self._loaded), told)

    def _reduced(self, record: Record) -> list[float]:
        reduced = reduce(record.readings(), self._loaded.protocol, record.checks())
        return [float(value) for value in reduced.brdf]

    def killed(self, run: Path, waits: Callable[[int, FileIO], bytes], at: int = -1) -> set[int]:
        """Run or resume in a fork that `waits` sees killed; return its accepted steps."""
        ours, theirs = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(ours)
            self._be_killed(run, theirs, at)
        os.close(theirs)
        with os.fdopen(ours, "rb", buffering=0) as told:
            return set(waits(child, told) + told.read())

    def _be_killed(self, run: Path, told: int, at: int) -> None:
        if at >= 0:
            recorder = ctypes.CDLL(None)
            recorder.recorder_begin(b"/dev/null")
            recorder.recorder_kill_at(at)
        try:
            self.scan(run, lambda step: os.write(told, bytes([step])) and None)
        finally:
            os._exit(0)

    def look(self, run: Path, accepted: set[int]) -> None:
        """Count what a killed scan has lost, duplicated or changed."""
        self.outcome.kills += 1
        self.outcome.accepted_before += len(accepted)
        with opened(run) as record:
            found = measured(record)
        steps = [r.step for r in found]
        self.outcome.lost += len(accepted - set(steps))
        self.outcome.duplicated += len(steps) - len(set(steps))
        self.outcome.not_the_plan_s += steps != [r.step for r in self._whole[: len(steps)]]
        self.outcome.unequal += found != self._whole[: len(found)]

    def _compare_whole(self, record: Record) -> None:
        """Count what else differs in the record of a whole scan."""

    def finish(self, run: Path) -> None:
        """Resume to the end; count results that differ from those of the scan without kills."""
        self.scan(run)
        with Record.open(run) as record:
            self.outcome.results_unequal += measured(record) != self._whole
            self.outcome.results_unequal += self._reduced(record) != self._brdf
            self._compare_whole(record)
            self.outcome.jumped += sum(check.jumped for check in record.checks())
        shutil.rmtree(run)


def measured(record: Record) -> list[Reading]:
    """Readings of a record in the order in which they were measured, without their dates."""
    return undated(sorted(record.readings(), key=lambda reading: reading.time_s))


def _after(steps: int, seconds: float) -> Callable[[int, FileIO], bytes]:
    """Kill that time after so many steps: scans are under way however fast the machine is."""

    def waits(child: int, told: FileIO) -> bytes:
        accepted = b""
        while len(accepted) < steps and (more := told.read(1)):
            accepted += more
        time.sleep(seconds)  # the random moment of the kill; no event is awaited
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        return accepted

    return waits


def at_random(killer: Killer, folder: Path, kills: int, seed: int) -> None:
    """Kill at random moments; some scans are killed again after they resume."""
    draw, run = random.Random(seed), folder / "run"

    def moment(left: int) -> Callable[[int, FileIO], bytes]:
        return _after(draw.randint(0, left), draw.uniform(0, 2 * killer.usual_step_s))

    while killer.outcome.kills < kills:
        accepted = killer.killed(run, moment(killer.steps))
        killer.look(run, accepted)
        while draw.random() < 0.3 and killer.outcome.kills < kills:
            killer.outcome.killed_twice += 1
            accepted |= killer.killed(run, moment(killer.steps - len(accepted)))
            killer.look(run, accepted)
        killer.finish(run)


def at_entries(killer: Killer, folder: Path, stride: int) -> None:
    """Kill before every n-th file operation, until the scan finishes."""
    run, at, ended = folder / "run", 1, [-1]

    def waits(child: int, _: FileIO) -> bytes:
        ended.append(os.waitpid(child, 0)[1])
        return b""

    while ended[-1] != 0:  # until no kill happens: there are no more entries
        steps = killer.killed(run, waits, at)
        killer.look(run, steps)
        killer.finish(run)
        at += stride


def recorded(folder: Path, log: Path) -> None:
    """Log the file operations of a scan, with a mark after each accepted step."""
    loaded = changed(small_scan(), keep_frames=True)
    plan, recorder = make_plan(loaded), ctypes.CDLL(None)

    def stopped_half_way(step: int) -> None:
        recorder.recorder_mark(step)
        if step == len(plan.steps) // 2:
            raise KeyboardInterrupt

    recorder.recorder_begin(os.fsencode(log))
    with suppress(KeyboardInterrupt):
        scan(folder / "deep" / "run", loaded, plan, stopped_half_way)
    scan(folder / "deep" / "run", loaded, plan, recorder.recorder_mark)


def main() -> None:
    folder = Path(sys.argv[1])
    if sys.argv[2] == "record":
        recorded(folder, Path(sys.argv[3]))
        return
    killer = Killer(folder, shortest_scan())
    if sys.argv[2] == "entries":
        at_entries(killer, folder, int(sys.argv[3]))
    else:
        at_random(killer, folder, int(sys.argv[2]), int(sys.argv[3]))
    sys.stdout.write(json.dumps(asdict(killer.outcome)))


if __name__ == "__main__":
    main()
