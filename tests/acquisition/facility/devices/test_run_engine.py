"""A run engine of bluesky scans a simulated rig: its pauses, ends and failures leave it safe."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from acquisition.facility.devices.rig_devices import RigDevices
from sim.scene.stage import SimulatedStage
from tests.support.facility.run_engine import (
    DEADLINE_S,
    HeldMoves,
    begun_in_thread,
    engine_and_documents,
    events,
    paused_after,
    stops,
)

pytest.importorskip("bluesky", reason="bluesky is not installed")
from bluesky import plan_stubs as bps
from bluesky import plans as bp
from bluesky.utils import FailedStatus, RunEngineInterrupted

ANGLES = [-60.0, -35.0, -10.0, 15.0, 50.0]


def scan(rig: RigDevices) -> Any:
    """White paper at theta_i = 30 degrees, seen from ANGLES."""
    rig.ready()
    yield from bps.mv(rig.theta_i, 30.0, rig.dphi, 0.0)
    return (yield from bp.list_scan([rig.camera, rig.lamp], rig.theta_r, ANGLES))


def at_rest_and_dark(rig: RigDevices) -> bool:
    return rig.lamp.read()["lamp"]["value"] == "dark" and not any(
        axis.locate()["readback"] != axis.locate()["readback"]
        for axis in (rig.theta_i, rig.dphi, rig.theta_r)
    )


def test_a_scan_measures_a_matt_sample_with_its_u(rig: RigDevices) -> None:
    engine, documents = engine_and_documents()
    engine(scan(rig))
    found = events(documents, "primary")
    assert [data["theta_r"] for data in found] == pytest.approx(ANGLES, abs=1e-9)
    assert {data["lamp"] for data in found} == {"light"}
    radiance = np.array([data["camera_radiance"] for data in found])
    u = np.array([data["camera_u_radiance"] for data in found])
    # Lambert's law: alike from everywhere, but for placement, drift and 0.02 deg of theta_i.
    assert np.all(np.abs(radiance / radiance.mean() - 1) < 5 * u / radiance + 1e-3)
    assert np.all(u / radiance < 0.01)
    assert stops(documents) == ["success"]
    assert at_rest_and_dark(rig)


def test_an_even_scan_of_two_axes_is_checked_step_by_step(rig: RigDevices) -> None:
    engine, documents = engine_and_documents()
    rig.ready()
    engine(bp.scan([rig.camera], rig.theta_r, -30.0, -10.0, rig.dphi, 0.0, 180.0, num=3))
    found = events(documents, "primary")
    assert [data["theta_r"] for data in found] == pytest.approx([-30.0, -20.0, -10.0])
    assert [data["dphi"] for data in found] == pytest.approx([0.0, 90.0, 180.0])


def test_a_refused_move_fails_with_our_message_and_the_lamp_goes_out(rig: RigDevices) -> None:
    engine, documents = engine_and_documents()
    with pytest.raises(FailedStatus) as failed:
        engine(bp.list_scan([rig.camera], rig.theta_r, [10.0, 95.0, 20.0]))
    assert "theta_r: 95 deg; allowed: -88 to 88 deg" in str(failed.value.__cause__)
    assert len(events(documents, "primary")) == 1
    assert stops(documents) == ["fail"]
    assert at_rest_and_dark(rig)
    engine(bps.mv(rig.theta_r, 20.0))
    assert rig.theta_r.locate()["readback"] == pytest.approx(20.0)


def test_a_scan_goes_on_after_a_pause_between_points(rig: RigDevices) -> None:
    engine, documents = engine_and_documents()
    with pytest.raises(RunEngineInterrupted):
        engine(paused_after(scan(rig), 2))
    assert len(events(documents, "primary")) == 2
    engine.resume()
    assert [d["theta_r"] for d in events(documents, "primary")] == pytest.approx(ANGLES, abs=1e-9)
    assert at_rest_and_dark(rig)


@pytest.mark.parametrize("end", ["resume", "stop", "abort", "halt"])
def test_a_pause_stops_the_axis_on_its_way(
    rig: RigDevices, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    engine, documents = engine_and_documents()
    held = HeldMoves(monkeypatch, "theta_r")

    def pause_once_moving() -> None:
        assert held.begun.wait(DEADLINE_S)
        engine.request_pause()

    with begun_in_thread(pause_once_moving), pytest.raises(RunEngineInterrupted):
        engine(scan(rig))
    assert held.stopped.is_set()
    held.held = False
    getattr(engine, end)()
    found = [data["theta_r"] for data in events(documents, "primary")]
    assert found == (pytest.approx(ANGLES, abs=1e-9) if end == "resume" else [])
    assert stops(documents) == [{"resume": "success", "stop": "success"}.get(end, "abort")]
    rig.theta_r.set(-5.0).wait(DEADLINE_S)
    assert rig.theta_r.locate()["readback"] == pytest.approx(-5.0)
    assert at_rest_and_dark(rig)


def test_a_stop_that_is_a_failure_fails_the_move(
    rig: RigDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.ready()
    held = HeldMoves(monkeypatch, "theta_r")
    moving, waiting = rig.theta_r.set(40.0), rig.theta_r.set(50.0)
    assert held.begun.wait(DEADLINE_S)
    rig.theta_r.stop(success=False)
    for status, where in ((moving, "on the way to 40 deg"), (waiting, "not moved to 50 deg")):
        assert where in str(status.exception(DEADLINE_S))


def test_a_lamp_that_a_plan_has_lit_is_dark_in_a_pause_and_at_the_end(rig: RigDevices) -> None:
    engine, _ = engine_and_documents()
    seen: list[object] = []

    def plan() -> Any:
        yield from bps.checkpoint()
        yield from bps.mv(rig.lamp, "light")
        yield from bps.checkpoint()
        yield from bps.pause()
        seen.append((yield from bps.rd(rig.lamp)))

    with pytest.raises(RunEngineInterrupted):
        engine(plan())
    rig.theta_r.unstage().wait(DEADLINE_S)  # what was asked for before has ended
    assert rig.lamp.locate() == {"setpoint": "dark", "readback": "dark"}
    engine.resume()
    assert seen == ["light"]
    rig.close()
    assert rig.lamp.read()["lamp"]["value"] == "dark"


def test_what_a_camera_s_staging_is_homing_is_halted_when_it_is_unstaged(
    rig: RigDevices, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()
    home = SimulatedStage.home

    def slow_home(stage: SimulatedStage) -> None:
        begun.set()
        assert go_on.wait(DEADLINE_S)
        home(stage)

    monkeypatch.setattr(SimulatedStage, "home", slow_home)
    staged = rig.camera.stage()
    assert begun.wait(DEADLINE_S)
    unstaged = rig.camera.unstage()
    go_on.set()
    error = staged.exception(DEADLINE_S)
    assert "halted, not homed" in str(error)  # the next axis is not begun
    assert unstaged.exception(DEADLINE_S) is None
    assert rig.lamp.read()["lamp"]["value"] == "dark"
