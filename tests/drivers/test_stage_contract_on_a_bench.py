"""Stage contract as on a bench: a rig file, its motors emulated controllers of unusual settings."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest

from instrument.clock import SystemClock
from sim.emulated.motor import Mechanics, Motor
from sim.emulated.newport_controller import NewportController
from sim.emulated.oriental_controller import OrientalController
from sim.emulated.wire import Controller, PtyWire
from sim.emulated.zaber_controller import ZaberController
from tests.support.paths import ROOT
from tests.support.stages.bench_rig import write_bench_rig

pytestmark = pytest.mark.waits

MECHANICS = Mechanics(speed_deg_per_s=400.0, acceleration_deg_per_s2=8000.0, homing_s=0.05)
KEYS = {
    "min_deg": -5.0, "max_deg": 80.0, "u_deg": 0.01, "speed_deg_per_s": 400.0,
    "acceleration_deg_per_s2": 8000.0, "settle_s": 0.0,
}  # fmt: skip


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Path]:
    """A CONEX-CC at address 3 with home at its upper end, an AZ drive, a Zaber stage at 9600."""

    def motor(home_deg: float) -> Motor:
        return Motor(replace(MECHANICS, home_deg=home_deg), SystemClock())

    newport = {"driver": "newport", "model": "CONEX-CC", "address": 3, "home_deg": 80.0}
    oriental = {"driver": "oriental", "unit": 7, "steps_per_deg": 250.0, "parity": "N",
                "baudrate": 57600, "sign": -1, "zero_deg": 12.0}  # fmt: skip
    zaber = {"driver": "zaber", "device": 5, "microsteps_per_deg": 1000.0, "baudrate": 9600,
             "home_deg": 30.0, "reply_s": 0.3}  # fmt: skip
    controllers: dict[str, tuple[Controller, dict[str, object]]] = {
        "theta_i": (NewportController(motor(80.0), 3, "CONEX-CC"), newport),
        "dphi": (OrientalController(motor(12.0), 7, 250.0), oriental),
        "theta_r": (ZaberController(motor(30.0), 5, 1000.0), zaber),
    }
    with ExitStack() as wires:
        axes = {
            name: KEYS | keys | {"port": wires.enter_context(PtyWire([controller])).port}
            for name, (controller, keys) in controllers.items()
        }
        yield write_bench_rig(tmp_path / "rig.yaml", **axes)


def test_the_stage_contract_runs_by_the_settings_of_a_rig_file(rig: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider",
               "-m", "hil", "--allow-motion", "--rig", str(rig),
               "tests/drivers/test_stage_contract.py"]  # fmt: skip
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout
    assert "33 passed" in done.stdout  # eleven tests of each axis
