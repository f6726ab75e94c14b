"""Scan of a protocol whose steps a run engine asks for: devices, record and results of one run.

Everything here runs in the rig's thread, but for what stops the axes.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from acquisition.engine.engine import Devices
from acquisition.engine.event_log import EventLogHandler, log_to_record
from acquisition.engine.frame_files import require_disk_space
from acquisition.engine.resume import Progress
from acquisition.facility.devices.halting_axis import Halted, HaltingAxis
from acquisition.facility.stepwise_engine import StepwiseEngine
from acquisition.plan.plan import Plan
from acquisition.results.finish import finish
from acquisition.results.run_folder import run_meta, write_run_inputs
from acquisition.rig import open_devices, require_own_calibration
from instrument.config.load import Loaded
from instrument.errors import DeviceError, Interlock, StorageError
from instrument.record.event_kinds import FAULT, FINISHED, INTERLOCK, OPERATOR, STOPPED
from instrument.record.reading import Reading
from instrument.record.record import Record

_BY = "by the run engine"


class ScanSession:
    """One scan from opening the devices to the run's files; `axes` are there once it has begun."""

    def __init__(self, loaded: Loaded, plan: Plan, folder: Path) -> None:
        self._loaded, self.plan, self.folder = loaded, plan, folder
        self.axes: dict[str, HaltingAxis] = {}
        self._opened = ExitStack()
        self._interrupted = self._finished = self._safe = False
        self._fault: Exception | None = None
        self._done: set[int] = set()

    def begin(self) -> None:
        """Create the record, open the devices, home them and take the first darks."""
        with ExitStack() as opening:
            loaded = self._loaded
            require_disk_space(self.plan, loaded, self.folder)
            meta = run_meta(loaded, self.plan)
            self._record = opening.enter_context(Record.create(self.folder, meta))
            opening.enter_context(self._record.claimed())
            write_run_inputs(self._record)
            self._log: EventLogHandler = opening.enter_context(log_to_record(self._record))
            self._devices = self._open(opening)
            self._engine = StepwiseEngine(
                loaded.protocol, loaded.rig, self._devices, self._record, lambda _: None
            )
            opening.callback(self._make_safe)
            self._begun_s = self._devices.clock.now_s()
            with self._noted():
                self._engine.begin(self.plan)
            self._opened = opening.pop_all()

    def _open(self, opening: ExitStack) -> Devices:
        loaded, devices = self._loaded, open_devices(self._loaded)
        opening.callback(devices.close)
        require_own_calibration(loaded.rig, loaded.rig_path, devices.camera)
        self.axes = {name: HaltingAxis.of(axis) for name, axis in devices.axes.items()}
        return replace(devices, axes=dict(self.axes))

    @property
    def halts(self) -> dict[str, int]:
        """Number of halts of each axis so far; from any thread."""
        return {name: axis.halts for name, axis in self.axes.items()}

    @property
    def reading(self) -> Reading | None:
        """The last reading; None before the first."""
        return self._engine.last if self.axes else None

    @property
    def identities(self) -> dict[str, str]:
        """Identity of each device by role; empty before the scan has begun."""
        return self._record.devices() if self.axes else {}

    def now_s(self) -> float:
        """Return the time of the rig's clock in seconds of the Unix epoch."""
        return self._devices.clock.utc().timestamp()

    def halt(self, *, expected: bool = True) -> None:
        """Halt all axes now, from any thread, and return once they were read to stand."""
        axes = list(self.axes.values())
        for axis in axes:
            axis.halt(expected=expected)
        for axis in axes:
            axis.finish_stop()

    def move(self, index: int, halts: dict[str, int]) -> None:
        """Move to the pose of a step; do nothing if it is measured already.

        halts: those of the axes when this was asked for; later ones end the move.
        """
        if index in self._done:
            return
        step = self.plan.steps[index]
        for name, axis in self.axes.items():
            axis.allow(halts[name])
        with self._noted():
            if self._interrupted:
                progress = Progress.of(self._record)
                self._engine.go_on(self.plan, progress, step)
                self._done = set(Progress.of(self._record).done)
                self._interrupted = False
            self._engine.go_to(self.plan, step)

    def measure(self, index: int) -> None:
        """Measure the step at whose pose the rig stands; do nothing if it is measured already."""
        if index in self._done:
            return
        with self._noted():
            if self._interrupted:
                raise DeviceError(f"the move to step {index} was halted: move there again")
            self._engine.measure(self.plan, self.plan.steps[index])
            self._done.add(index)

    def note_pause(self) -> None:
        """Record that the run engine has paused the scan."""
        self._add_event(OPERATOR, f"paused {_BY}")

    def note_resume(self) -> None:
        """Record that the scan goes on, with a drift check where the plan has one."""
        self._interrupted = True
        self._add_event(OPERATOR, f"continued {_BY}")

    def missing(self) -> list[int]:
        """Return the indices of the steps still to be measured, in order."""
        return [step.index for step in Progress.of(self._record).missing(self.plan)]

    def finish(self) -> str:
        """End the scan, fit and report; return the text of its measurements.csv."""
        clock = self._devices.clock
        self._add_event(FINISHED, f"{len(self.plan.steps)} steps")
        self._record.set_meta("scan_s", f"{clock.now_s() - self._begun_s:.1f}")
        self._record.set_meta("finished_utc", clock.utc().isoformat(timespec="seconds"))
        self._finished = True
        self._make_safe()
        finish(self._record, self._loaded)
        return (self.folder / "measurements.csv").read_text()

    def end(self) -> None:
        """Make the rig safe, record why the scan ended, and close all; may be called twice."""
        if not self.axes:
            return
        self._make_safe()
        if not self._finished:
            self._record_end()
        self.axes = {}
        self._opened.close()

    def _record_end(self) -> None:
        fault = self._fault
        self._log.write()
        if isinstance(fault, Interlock):
            self._add_event(INTERLOCK, str(fault))
        kind, why = (STOPPED, f"stopped {_BY}") if fault is None else (FAULT, str(fault))
        self._add_event(kind, why)

    @contextmanager
    def _noted(self) -> Iterator[None]:
        """Keep in mind what ends the scan, and add to it the command that resumes the scan.

        A move that was halted for a pause is no failure.
        """
        try:
            yield
            self._log.write()
        except Halted as halted:
            self._interrupted = True
            if not halted.expected:
                raise
        except (DeviceError, StorageError) as error:
            self._fault = error
            raise type(error)(f"{error}\nGo on with: gonio resume {self.folder}") from error

    def _make_safe(self) -> None:
        if not self._safe:
            self._safe = True
            self._engine.make_safe()
            self._log.write()

    def _add_event(self, kind: str, text: str) -> None:
        self._record.add_event(self._devices.clock.utc().isoformat(), kind, text)
