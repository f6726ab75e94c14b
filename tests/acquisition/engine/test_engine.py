"""The engine: what is on disk when, what a stop leaves behind, what a fault leads to."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices, Engine
from acquisition.plan.plan import Plan, make_plan
from acquisition.results.reduction import reduce
from acquisition.rig import open_devices
from instrument.config.load import Loaded, load_protocol
from instrument.devices import Frame, Request
from instrument.errors import DeviceError, OperatorStop
from instrument.record.record import FILE_NAME, Record
from tests.support.paths import CONFIGS
from tests.support.scans import changed, small_scan
from tests.support.stand_ins import Spy


@pytest.fixture(scope="module")
def small() -> Loaded:
    """Two incidences, five view angles, all references; all pixels."""
    return small_scan(shrink=1)


@pytest.fixture
def record(tmp_path: Path) -> Iterator[Record]:
    with Record.create(tmp_path / "run", {}) as record:
        yield record


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
    seen: list[int] = []

    class Watching:
        """theta_r, that looks into the record with a connection of its own when it arrives."""

        def __init__(self, axis: Axis) -> None:
            self._axis = axis

        def finish_move(self) -> None:
            self._axis.finish_move()
            path = record.folder / FILE_NAME
            other = sqlite3.connect(f"file:{path}?mode=ro", uri=True)
            seen.append(other.execute("SELECT COUNT(*) FROM reading").fetchone()[0])
            other.close()

        def __getattr__(self, name: str) -> object:
            return getattr(self._axis, name)

    axes = devices.axes | {"theta_r": Watching(devices.axes["theta_r"])}
    plan = run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # a stand-in
    moved = [s.index for s in plan.steps for m in s.moves if m.axis == "theta_r"]
    assert seen == moved  # on arrival at step n, n readings are there


def test_the_stage_is_under_way_while_the_frames_are_reduced(
    small: Loaded, record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices, calls = open_devices(small), []
    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    real = record.add_reading
    monkeypatch.setattr(record, "add_reading", lambda *a: (calls.append("accept"), real(*a)))
    run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # spies
    at = [n for n, call in enumerate(calls) if call == "accept"][3]  # within one arc
    before = [c for c in calls[:at] if "move" in c][-1]
    after = next(c for c in calls[at:] if "move" in c)
    assert (before, after) == ("theta_r.start_move", "theta_r.finish_move")


def test_a_dark_is_taken_at_every_exposure_used(small: Loaded, record: Record) -> None:
    run(small, record)
    used = {r.exposure_s for r in record.readings()}
    assert {dark[0] for dark in record.darks()} == used


def test_by_hand_the_darks_come_first_and_the_lamp_is_covered_once(record: Record) -> None:
    demo = load_protocol(CONFIGS / "protocols" / "demo.yaml", CONFIGS / "rigs" / "paper_1995.yaml")
    sweep = {"theta_i_deg": [30.0, 60.0], "dphi_deg": [0.0], "theta_r_deg": [-40.0, 0.0, 50.0]}
    loaded, calls = changed(demo, sweeps=[sweep]), []
    devices = open_devices(loaded)
    run(loaded, record, replace(devices, lamp=Spy(devices.lamp, calls, "lamp")))  # type: ignore[arg-type]  # a spy
    assert [c for c in calls if c != "lamp.identity"] == ["lamp.darken", "lamp.light"]
    assert {r.exposure_s for r in record.readings()} <= {dark[0] for dark in record.darks()}
    asked = [text for _, kind, text in record.events() if kind == "operator"]
    assert sum("theta_i set to" in text for text in asked) == 2
    assert [text for text in asked if "covered" in text] == [
        "lamp covered for the darks",
        "lamp uncovered",
    ]


def test_the_brightest_part_of_the_window_stays_within_the_target(
    small: Loaded, record: Record
) -> None:
    run(small, record)
    camera, target = small.rig.camera, small.protocol.exposure_target
    full = camera.max_dn - camera.black_level_dn
    level = np.array([(r.peak_dn - camera.black_level_dn) / full for r in record.readings()])
    assert np.all(level < target * 1.03)
    assert np.all(level > target / 2**0.5 / 1.1)  # the ladder's step is sqrt 2


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt, DeviceError("camera: no frame")])
def test_whatever_ends_a_scan_the_motion_stops_and_the_lamp_is_dark(
    small: Loaded, record: Record, interrupt: BaseException
) -> None:
    devices, calls = open_devices(small), []

    class Failing:
        def __init__(self, camera: object) -> None:
            self._camera, self._left = camera, 12

        def grab(self, count: int) -> list[Frame]:
            self._left -= 1
            if not self._left:
                raise interrupt
            frames: list[Frame] = self._camera.grab(count)  # type: ignore[attr-defined]  # a stand-in
            return frames

        def __getattr__(self, name: str) -> object:
            return getattr(self._camera, name)

    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    broken = replace(
        devices,
        axes=axes,  # type: ignore[arg-type]  # spies
        camera=Failing(devices.camera),  # type: ignore[arg-type]  # a stand-in
        lamp=Spy(devices.lamp, calls, "lamp"),  # type: ignore[arg-type]  # a spy
    )
    with pytest.raises(type(interrupt) if isinstance(interrupt, Exception) else interrupt):
        run(small, record, broken)
    assert calls[-4:] == ["theta_i.stop", "dphi.stop", "theta_r.stop", "lamp.darken"]
    assert record.readings()


def test_an_axis_that_does_not_answer_keeps_no_other_from_being_stopped(
    small: Loaded, record: Record
) -> None:
    devices, calls = open_devices(small), []

    class Mute:
        def stop(self) -> None:
            raise DeviceError("theta_i: no answer")

        def __getattr__(self, name: str) -> object:
            return getattr(devices.axes["theta_i"], name)

    axes = {"theta_i": Mute(), "theta_r": Spy(devices.axes["theta_r"], calls, "theta_r")}
    run(small, record, replace(devices, axes=devices.axes | axes))  # type: ignore[arg-type, operator]  # stand-ins
    assert calls[-1] == "theta_r.stop"


def test_a_ctrl_c_while_the_rig_is_made_safe_keeps_nothing_from_being_stopped(
    small: Loaded, record: Record
) -> None:
    devices, calls = open_devices(small), []

    class Noting:
        """Notes each stop when it is called; that of theta_i is interrupted the first time."""

        def __init__(self, name: str) -> None:
            self._name, self._axis = name, devices.axes[name]

        def stop(self) -> None:
            calls.append(self._name)
            if calls == ["theta_i"]:
                raise KeyboardInterrupt
            self._axis.stop()

        def __getattr__(self, name: str) -> object:
            return getattr(self._axis, name)

    axes = {name: Noting(name) for name in devices.axes}
    run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # stand-ins
    assert calls == ["theta_i", "theta_i", "dphi", "theta_r"]


def test_an_axis_that_stands_elsewhere_than_asked_ends_the_scan(
    small: Loaded, record: Record
) -> None:
    devices = open_devices(small)

    class Slipping:
        def __init__(self) -> None:
            self._stage = devices.axes["theta_r"]._stage

        def wait(self) -> float:
            return self._stage.wait() + 0.3

        def __getattr__(self, name: str) -> object:
            return getattr(self._stage, name)

    axis = Axis("theta_r", Slipping(), small.rig.axes.theta_r, devices.clock)  # type: ignore[arg-type]  # a stand-in
    with pytest.raises(DeviceError, match=r"theta_r: stands at .*3 deg instead of 10 deg"):
        run(small, record, replace(devices, axes=devices.axes | {"theta_r": axis}))
    assert not record.readings()


def test_nothing_is_sent_past_a_limit_of_the_rig_file(small: Loaded) -> None:
    axis = open_devices(small).axes["theta_r"]
    with pytest.raises(DeviceError, match=r"theta_r: 89 deg is outside the rig's limits, -88 to"):
        axis.start_move(89.0)


def test_the_plan_predicts_how_long_the_scan_takes(small: Loaded, record: Record) -> None:
    devices = open_devices(small)
    plan = run(small, record, devices)
    assert plan.duration_s == pytest.approx(devices.clock.now_s(), rel=0.1)


def test_drift_is_followed_and_taken_out(small: Loaded, tmp_path: Path) -> None:
    brdf = []
    for drift in (0.0, 0.9):  # of the lamp, in an hour: 9 % over this scan
        simulation = small.rig.simulation.model_copy(update={"lamp_drift_per_hour": drift})
        loaded = changed(small, rig={"simulation": simulation})
        with Record.create(tmp_path / str(drift), {}) as record:
            run(loaded, record)
            brdf.append(reduce(record.readings(), loaded.protocol, ()).brdf)
    assert brdf[1] == pytest.approx(brdf[0], rel=2e-3)
    # Not corrected, sample and tile differ by what the lamp did between them.
    raw = _reduced_without_checks(small, tmp_path / "0.9")
    assert np.min(raw / brdf[0]) > 1.01


def _reduced_without_checks(loaded: Loaded, folder: Path) -> np.ndarray:
    with Record.open(folder) as record:
        readings = [r for r in record.readings() if r.kind != "drift"]
        return reduce(readings, loaded.protocol, ()).brdf


def test_what_was_exposed_is_accepted_before_the_operator_is_asked(
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


def test_a_scan_cut_at_any_step_can_be_reduced(small: Loaded, record: Record) -> None:
    run(small, record)
    readings = record.readings()
    for count in range(len(readings) + 1):
        reduced = reduce(readings[:count], small.protocol, ())
        assert len(reduced.flags) == len(reduced.points)
        assert np.all(np.isfinite(reduced.brdf[reduced.sound]))


def test_a_scan_goes_on_with_the_same_devices_only(small: Loaded, record: Record) -> None:
    record.add_device("theta_r", "another stage, serial 7")
    devices, calls = open_devices(small), []
    axes = {n: Spy(a, calls, n) for n, a in devices.axes.items()}
    with pytest.raises(DeviceError, match=r"theta_r: .* answers, but the scan began with 'another"):
        run(small, record, replace(devices, axes=axes))  # type: ignore[arg-type]  # spies
    assert not any("home" in call or "start_move" in call for call in calls)
