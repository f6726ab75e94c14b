"""A scan in a process of its own that is stopped in the middle of a move; writes how it went.

`python -m tests.support.stages.stop_child BENCH HOW ...`: SIGINT, SIGTERM, or `exception` in the
scan itself, a scan for each. Writes the seconds from that moment to the stop's arrival on the wire.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from acquisition.cli import stop_on_signals
from acquisition.engine.axis import Axis
from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.rig import open_devices
from instrument.clock import SystemClock
from instrument.config.load import load_protocol
from instrument.errors import DeviceError
from instrument.record.record import Record
from tests.support.paths import CONFIGS
from tests.support.scans import changed
from tests.support.stages.emulated_stages import EMULATED_STAGES, SLOW, EmulatedStage

DEADLINE_S = 10.0


def main(name: str, how: str) -> None:
    stop_on_signals()  # anew for each scan: the stop before was another command's
    with EMULATED_STAGES[name](SLOW) as bench, TemporaryDirectory() as folder:
        moment: list[float] = []
        threading.Thread(target=_interrupt, args=(bench, how, moment), daemon=True).start()
        try:
            _scan(bench, how, moment, Path(folder))
        except (KeyboardInterrupt, DeviceError) as error:
            sys.stdout.write(f"{type(error).__name__}\n")
        end_s = time.monotonic() + DEADLINE_S
        while not (stops := _stops(bench, moment)):
            if time.monotonic() > end_s:
                raise SystemExit("no stop on the wire")
            time.sleep(0.001)
        sys.stdout.write(f"{stops[0] - moment[0]} {bench.motor.moving}\n")


def _stops(bench: EmulatedStage, moment: list[float]) -> list[float]:
    """When stops came that belong to what happened at that moment."""
    return [at for at, data in bench.wire.seen if moment and at >= moment[0] and bench.stop in data]


def _interrupt(bench: EmulatedStage, how: str, moment: list[float]) -> None:
    """Once the stage is well under way."""
    while not (bench.motor.moving and abs(bench.motor.position_deg) > 3):
        time.sleep(0.001)
    moment.append(time.monotonic())
    if how != "exception":
        os.kill(os.getpid(), getattr(signal, how))


def _scan(bench: EmulatedStage, how: str, moment: list[float], folder: Path) -> None:
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-70.0, 0.0]}
    loaded = changed(load_protocol(CONFIGS / "protocols" / "demo.yaml"), sweeps=[sweep])
    devices = open_devices(loaded)
    stage = bench.stage
    if how == "exception":
        stage = _Failing(stage, moment)  # type: ignore[assignment]  # a stand-in
    axis = Axis("theta_r", stage, loaded.rig.axes.theta_r, SystemClock())
    devices = replace(devices, axes={**devices.axes, "theta_r": axis})
    with Record.create(folder / "run", {}) as record:
        Engine(loaded.protocol, loaded.rig, devices, record, lambda _: None).run(make_plan(loaded))


class _Failing:
    """A stage with which the scan's own work fails in the middle of a move."""

    def __init__(self, stage: object, moment: list[float]) -> None:
        self._stage, self._moment = stage, moment

    def wait(self) -> float:
        end_s = time.monotonic() + DEADLINE_S
        while not self._moment and time.monotonic() < end_s:
            self._stage.position_deg()  # type: ignore[attr-defined]  # a stand-in
        raise DeviceError("something else failed")

    def __getattr__(self, name: str) -> object:
        return getattr(self._stage, name)


if __name__ == "__main__":
    for each in sys.argv[2:]:
        main(sys.argv[1], each)
