"""Engine: what is on disk at which time, and what a stop or a fault leaves behind."""

from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition.engine import frame_reduction
from acquisition.engine.engine import Devices, Engine
from acquisition.plan.moves import Move, moves_between
from acquisition.plan.plan import Plan, make_plan
from acquisition.plan.pose import Pose
from acquisition.rig import open_devices
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.devices import Frame, Request
from instrument.errors import DeviceError, OperatorStop
from instrument.record.record import FILE_NAME, Record
from tests.support.stand_ins import PassThrough, Spy


def run(loaded: Loaded, record: Record, devices: Devices | None = None) -> Plan:
    plan = make_plan(loaded)
    devices = devices or open_devices(loaded)
    Engine(loaded.protocol, loaded.rig, devices, record, [].append).run(plan)
    return plan


def test_every_step_of_the_plan_is_read_once_in_order(small: Loaded, record: Record) -> None:
    plan = run(small, record)
    readings = record.readings()
    assert [r.step for r in readings] == [s.index for s in plan.steps]
    assert [(r.kind, r.surface) for r in readings] == [(s.kind, s.surface) for s in plan.steps]
    assert {r.frames for r in readings} == {4}
    assert not any(r.flags for r in readings)


def test_two_runs_of_one_seed_are_the_same_but_for_the_date(small: Loaded, tmp_path: Path) -> None:
    rows = []
    for name in ("a", "b"):
        with Record.create(tmp_path / name, {}) as record:
            run(small, record)
            rows.append([replace(r, time_utc="") for r in record.readings()])
    assert rows[0] == rows[1]


def test_a_reading_is_on_disk_before_the_next_move_counts_as_done(
    small: Loaded, record: Record
) -> None:
    devices = open_devices(small)
    steps, seen = [0], list[tuple[int, int]]()

    class Watching(PassThrough):
        """Camera that counts the readings on disk, over a connection of its own."""

        def grab(self, count: int) -> list[Frame]:
            path = record.folder / FILE_NAME
            other = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
            seen.append((steps[-1], *other.execute("SELECT COUNT(*) FROM reading").fetchone()))
            other.close()
            return devices.camera.grab(count)

    def begin_step(step: int, scan_s: float) -> None:
        steps.append(step)
        devices.begin_step(step, scan_s)

    camera = Watching(devices.camera)
    plan = run(small, record, replace(devices, camera=camera, begin_step=begin_step))  # type: ignore[arg-type]  # a stand-in
    assert {step for step, _ in seen} == {step.index for step in plan.steps}
    assert [count for _, count in seen] == [step for step, _ in seen]


def test_the_stage_is_under_way_while_the_frames_are_reduced(
    small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices, calls = open_devices(small), []
    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    real = frame_reduction.measure
    monkeypatch.setattr(
        frame_reduction, "measure", lambda *a: (calls.append("reduce"), real(*a))[1]
    )
    run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # spies
    at = [n for n, call in enumerate(calls) if call == "reduce"][3]  # within one arc
    before = [c for c in calls[:at] if "move" in c][-1]
    after = next(c for c in calls[at:] if "move" in c)
    assert (before, after) == ("theta_r.start_move", "theta_r.finish_move")


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, DeviceError("camera: no frame")])
def test_however_a_scan_ends_motion_is_stopped_and_the_lamp_darkened(
    small: Loaded, record: Record, interrupt: BaseException
) -> None:
    devices, calls = open_devices(small), []

    class Failing(PassThrough):
        """A camera that fails at its twelfth series of frames."""

        left = 12

        def grab(self, count: int) -> list[Frame]:
            self.left -= 1
            if not self.left:
                raise interrupt
            return devices.camera.grab(count)

    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    broken = replace(
        devices,
        axes=axes,  # type: ignore[arg-type]  # spies
        camera=Failing(devices.camera),  # type: ignore[arg-type]  # a stand-in
        lamp=Spy(devices.lamp, calls, "lamp"),  # type: ignore[arg-type]  # a spy
    )
    with pytest.raises(type(interrupt) if isinstance(interrupt, Exception) else interrupt):
        run(small, record, broken)
    axes = ("theta_i", "dphi", "theta_r")
    stops = [f"{name}.{half}_stop" for half in ("begin", "finish") for name in axes]
    assert calls[-7:] == [*stops, "lamp.darken"]
    assert record.readings()


def test_the_plan_predicts_how_long_the_scan_takes(small: Loaded, record: Record) -> None:
    devices = open_devices(small)
    plan = run(small, record, devices)
    assert plan.duration_s == pytest.approx(devices.clock.now_s(), rel=0.1)


def test_exposed_frames_are_accepted_before_the_operator_is_asked(
    small: Loaded, record: Record
) -> None:
    devices = open_devices(small)

    class Refusing:
        """Puts the tile there, and will not change it for the sample."""

        def ask(self, request: Request) -> str:
            if request.surface == "sample":
                raise OperatorStop("no")
            return devices.operator.ask(request)

    with pytest.raises(OperatorStop):
        run(small, record, replace(devices, operator=Refusing()))
    assert {r.kind for r in record.readings()} == {"tile"}
    assert len(record.readings()) == 2


def test_a_scan_goes_on_with_the_same_devices_only(small: Loaded, record: Record) -> None:
    record.add_device("theta_r", "another stage, serial 7")
    devices, calls = open_devices(small), []
    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    with pytest.raises(DeviceError, match=r"theta_r: .* answers, but the scan began with 'another"):
        run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # spies
    assert not any("home" in call or "start_move" in call for call in calls)


def test_an_engine_that_has_ended_moves_nothing_again(small: Loaded, record: Record) -> None:
    engine = Engine(small.protocol, small.rig, open_devices(small), record, [].append)
    engine.run(make_plan(small))
    with pytest.raises(DeviceError, match="nothing moves again before the operator"):
        engine.run(make_plan(small))


def test_the_record_holds_the_settings_of_every_device(small: Loaded, record: Record) -> None:
    run(small, record)
    settings = record.settings()
    assert set(settings) == {"camera", "theta_i", "dphi", "theta_r"}
    assert settings["theta_r"]["limits_deg"] == "-88 to 88"
    assert settings["camera"]["bit_depth"] == "12"


def test_the_engine_makes_the_planned_moves(
    small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, calls = make_plan(small), []

    def worked_out(start: Pose, end: Pose, rig: Rig) -> tuple[Move, ...]:
        calls.append((start, end))
        return moves_between(start, end, rig)

    for module in ("acquisition.plan.plan", "acquisition.engine.positioner"):
        monkeypatch.setattr(f"{module}.moves_between", worked_out)
    Engine(small.protocol, small.rig, open_devices(small), record, [].append).run(plan)
    assert not calls
    assert len(record.readings()) == len(plan.steps)
