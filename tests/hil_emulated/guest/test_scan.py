"""A whole scan: real drivers, real kernel, frames of the scene from where the motors stand."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hil_emulated.guest.devices import CAMERA, PORTS, plug_in
from tests.hil_emulated.guest.terminal import gonio_at_terminal
from tests.hil_emulated.link import Bench
from tests.support.whole_scans.simulated_rig import assert_same_within_noise, points

pytestmark = [pytest.mark.hil, pytest.mark.slow]

PROTOCOL = Path(__file__).parents[1] / "scan.yaml"


@pytest.fixture
def scene(camera: Bench, slow: bool) -> Bench:
    if not slow:
        pytest.skip("whole scans: with --slow")
    camera.show("scene")
    return camera


def doing(bench: Bench) -> dict[str, Callable[[], None]]:
    return {
        "Cover the lamp": lambda: bench.light(False),
        "Uncover the lamp": lambda: bench.light(True),
        "the white tile": lambda: bench.place("white tile"),
        "sample": lambda: bench.place("sample"),
    }


def test_a_scan_goes_on_after_its_camera_was_unplugged(scene: Bench, tmp_path: Path) -> None:
    run = tmp_path / "run"
    scene.unplug_in_sweep("1-1", "theta_r", -50.0, 0.0)
    code, shown = gonio_at_terminal("run", PROTOCOL, "--out", run, doing=doing(scene))
    assert code == 3, shown
    assert "camera" in shown
    plug_in("1-1")
    code, shown = gonio_at_terminal("resume", run, doing=doing(scene))
    assert code == 0, shown
    assert_same_within_noise(points(run), scene.simulated_points())
    for node in (CAMERA, *(PORTS[name] for name in ("SMC100", "AZ", "ZABER"))):
        os.close(os.open(node, os.O_RDWR | os.O_NOCTTY))  # names the drivers of the command
    with sqlite3.connect(f"file:{run / 'record.sqlite'}?mode=ro", uri=True) as record:
        devices = dict(record.execute("SELECT role, identity FROM device"))
    assert "uvcvideo" in devices["camera"]
    assert "Zaber" in devices["theta_r"]
