"""Scans stopped, failed, refused, killed and resumed in any order: the record is of one scan.

A pause is a Ctrl-C followed by `gonio resume`.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from acquisition.commands.scan_session import scan
from acquisition.engine.engine import Devices, Engine
from acquisition.engine.resume import Progress
from acquisition.plan.plan import Plan, make_plan
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.config.protocol import DriftCheck, References, WhiteTile
from instrument.errors import DeviceError, InputError, OperatorStop
from instrument.record.reading import Reading
from instrument.record.record import FILE_NAME, Record
from tests.support.scans import changed, small_scan, undated
from tests.support.storage.memory_folder import RAM

BEYOND_END = 400  # more device calls than any of these scans makes


class Killed(BaseException):
    """The process was killed: no clean-up takes place."""


@cache
def tiny_scan() -> Loaded:
    """Twelve steps: two incidences with three views, white tile, drift checks; a tiny camera."""
    small = small_scan(shrink=20)
    return changed(
        small,
        sweeps=[
            {"theta_i_deg": [30.0, 60.0], "dphi_deg": [0.0], "theta_r_deg": [-35.0, 0.0, 35.0]}
        ],
        references=References(
            white_tile=WhiteTile(reflectance=0.99, u_reflectance=0.005, theta_r_deg=10.0, frames=2),
            drift_check=DriftCheck(theta_r_deg=10.0, every_points=2),
        ),
        window=small.protocol.window.model_copy(update={"min_pixels": 10}),
        frames_per_point=2,
        dark_frames=2,
    )


@cache
def tiny_plan() -> Plan:
    return make_plan(tiny_scan())


@cache
def undisturbed() -> tuple[Reading, ...]:
    """Readings of the scan without interruption."""
    loaded = tiny_scan()
    with TemporaryDirectory() as folder, Record.create(Path(folder) / "run", {}) as record:
        Engine(loaded.protocol, loaded.rig, open_devices(loaded), record, [].append).run(
            tiny_plan()
        )
        return tuple(undated(record.readings()))


@dataclass
class Tripwire:
    """Passes every device call; raises `error` at the first suitable call after number `at`.

    `impatient`: raise so many more Ctrl-C, at the first stops after that. tripped: the call at
    which the error was raised.
    """

    at: int = BEYOND_END
    error: BaseException | None = None
    impatient: int = 0
    calls: list[str] = field(default_factory=list)
    tripped: str = ""
    dead: bool = False

    def around(self, name: str, device: object) -> Any:
        """The device with the tripwire before each of its calls."""
        return _Wired(self, name, device)

    def passing(self, name: str) -> None:
        if self.dead:
            raise Killed
        self.calls.append(name)
        error = self.error
        if len(self.calls) > self.at and error is not None and self._fits(name, error):
            self.error, self.tripped, self.dead = None, name, isinstance(error, Killed)
            raise error
        if error is None and self.impatient and name.endswith("_stop"):
            self.impatient -= 1
            raise KeyboardInterrupt

    def _fits(self, name: str, error: BaseException) -> bool:
        """Only the operator refuses; a device error during the safe stop does not end a scan."""
        if isinstance(error, OperatorStop):
            return name == "operator.ask"
        return not (isinstance(error, DeviceError) and makes_safe(name))


def makes_safe(call: str) -> bool:
    """Return True for the calls of which the end of a scan consists."""
    return call.endswith("_stop") or call == "lamp.darken"


class _Wired:
    def __init__(self, wire: Tripwire, name: str, device: object) -> None:
        self._wire, self._name, self._device = wire, name, device

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._device, name)
        if not callable(attribute):
            return attribute

        def call(*arguments: object) -> object:
            self._wire.passing(f"{self._name}.{name}")
            return attribute(*arguments)

        return call


def wired(devices: Devices, wire: Tripwire) -> Devices:
    axes = {name: wire.around(name, axis) for name, axis in devices.axes.items()}
    named = {
        name: wire.around(name, getattr(devices, name)) for name in ("camera", "lamp", "operator")
    }
    return replace(devices, axes=axes, **named)


ENDS: dict[str, Callable[[], BaseException]] = {
    "stopped": KeyboardInterrupt,
    "refused": lambda: OperatorStop("no"),
    "fault": lambda: DeviceError("camera: no frame"),
    "killed": Killed,
}
RAISED = {
    "stopped": OperatorStop, "refused": OperatorStop, "fault": DeviceError, "killed": Killed,
}  # fmt: skip
EVENT = {"stopped": "stopped", "refused": "stopped", "fault": "fault"}


class ScanMachine(RuleBasedStateMachine):
    """One run folder and the scans into it; each scan starts with axes not homed.

    `ends`: events that the scans so far must have recorded.
    """

    @initialize()
    def begin(self) -> None:
        self._open = ExitStack()
        folder = self._open.enter_context(TemporaryDirectory(dir=RAM if RAM.is_dir() else None))
        self.folder = Path(folder) / "run"
        self.record = Record.create(self.folder, {})
        self.begun, self.ends = False, list[str]()
        self.wire, self.engine = Tripwire(), None

    def teardown(self) -> None:
        """Resuming to the end gives the complete scan, whatever happened before."""
        if not hasattr(self, "record"):
            return
        if not self.complete:
            self.run(None)
        assert undated(self.record.readings()) == list(undisturbed())
        self.record.close()
        self._open.close()

    @property
    def complete(self) -> bool:
        return len(self.record.readings()) == len(tiny_plan().steps)

    def run(self, end: str | None, at: int = BEYOND_END, impatient: int = 0) -> None:
        """Scan or resume, as the commands do, until a device call ends it."""
        loaded, before = tiny_scan(), Progress.of(self.record) if self.begun else None
        self.begun = True
        self.wire = Tripwire(at, ENDS[end]() if end else None, impatient if end else 0)
        with (
            patch("acquisition.commands.scan_session.open_devices", self._opened),
            patch("acquisition.commands.scan_session.Engine", self._made),
        ):
            try:
                with self.record.claimed():
                    scan(loaded, tiny_plan(), self.record, before)
            except (OperatorStop, DeviceError, Killed) as error:
                how, raised = end or "", error
            else:
                how, raised = "", None
        expected = (RAISED[end], end) if end and self._came_in_time(end) else (type(None), "")
        assert (type(raised), how) == expected
        self._ended(how)
        self._left_safe()

    def _came_in_time(self, end: str) -> bool:
        """False without an error, and for a Ctrl-C once all is measured and the rig made safe."""
        late = end == "stopped" and makes_safe(self.wire.tripped) and self.complete
        return bool(self.wire.tripped) and not late

    def _opened(self, loaded: Loaded) -> Devices:
        return wired(open_devices(loaded), self.wire)

    def _made(self, *arguments: Any, **options: Any) -> Engine:
        self.engine = Engine(*arguments, **options)
        return self.engine

    def _ended(self, end: str) -> None:
        if end == "killed":
            self.record.close()
            self.record, self.engine = Record.open(self.folder), None
        else:
            self.ends.append(EVENT.get(end, "finished"))

    def _left_safe(self) -> None:
        """Every axis was stopped after the last motion began, and the lamp is dark."""
        if self.wire.dead:
            return
        calls = self.wire.calls
        begun = [n for n, c in enumerate(calls) if c.endswith((".start_move", ".home"))]
        last = begun[-1] if begun else -1
        axes, halves = ("theta_i", "dphi", "theta_r"), ("begin_stop", "finish_stop")
        assert {f"{a}.{half}" for a in axes for half in halves} <= set(calls[last + 1 :])
        lamp = [c for c in calls if c in ("lamp.light", "lamp.darken")]
        assert lamp[-1] == "lamp.darken"

    @precondition(lambda self: not self.complete)
    @rule(end=st.sampled_from(list(ENDS)), at=st.integers(0, 150), impatient=st.integers(0, 3))
    def scan_until(self, end: str, at: int, impatient: int) -> None:
        self.run(end, at, impatient)

    @precondition(lambda self: self.engine is not None)
    @rule()
    def engine_is_latched(self) -> None:
        """An engine whose scan has ended moves nothing again."""
        calls = list(self.wire.calls)
        with pytest.raises(DeviceError, match="nothing moves again before the operator"):
            self.engine.run(tiny_plan(), Progress.of(self.record))
        assert self.wire.calls == calls

    @rule()
    def claimed_twice(self) -> None:
        """A second scan into a claimed run is refused, naming the first process; afterwards not."""
        with Record.open(self.folder) as other:
            with (
                self.record.claimed(),
                pytest.raises(InputError, match=rf"process {os.getpid()} is scanning"),
                other.claimed(),
            ):
                pass
            with other.claimed():
                pass

    @rule()
    def opened_again(self) -> None:
        self.record.close()
        self.record = Record.open(self.folder)

    @invariant()
    def readings_are_the_first_of_the_undisturbed_scan(self) -> None:
        if hasattr(self, "record"):
            readings = undated(self.record.readings())
            assert readings == list(undisturbed()[: len(readings)])

    @invariant()
    def frames_previews_and_darks_belong_to_accepted_readings(self) -> None:
        if not hasattr(self, "record"):
            return
        readings = self.record.readings()
        other = sqlite3.connect(f"file:{self.folder / FILE_NAME}?mode=ro", uri=True)
        frames = dict(other.execute("SELECT step, count(*) FROM frame GROUP BY step"))
        other.close()
        assert frames == {r.step: r.frames for r in readings}
        shown = [step.index for step in tiny_plan().steps[: len(readings)] if step.preview]
        assert [preview.step for preview in self.record.previews()] == shown
        assert {r.exposure_s for r in readings} <= {dark[0] for dark in self.record.darks()}
        assert not any(check.jumped for check in self.record.checks())

    @invariant()
    def every_end_is_recorded(self) -> None:
        if hasattr(self, "record"):
            told = ("stopped", "fault", "finished")
            assert [kind for _, kind, _ in self.record.events() if kind in told] == self.ends


@pytest.mark.slow
def test_a_scan_ended_and_resumed_any_number_of_times_is_the_same_scan(slow: bool) -> None:
    machine: Any = ScanMachine
    examples, steps = (400, 15) if slow else (12, 6)
    run_state_machine_as_test(
        machine,
        settings=settings(max_examples=examples, stateful_step_count=steps, derandomize=not slow),
    )
