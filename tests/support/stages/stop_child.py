"""Scan in a process of its own that is stopped in the middle of a move, for `test_stop`.

Arguments: STAGE CAUSE ..., a cause being SIGINT, SIGTERM, or `exception` in the scan itself, with
one scan for each. Prints the error's type, then the seconds from the cause to the arrival of the
stop on the wire, and whether the motor still moves.
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

from acquisition.engine.axis import Axis
from acquisition.engine.engine import Engine
from acquisition.plan.plan import make_plan
from acquisition.rig import open_devices
from acquisition.terminal import stop_signals
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.stop_thread import stopped_by_signals
from instrument.clock import SystemClock
from instrument.errors import DeviceError
from instrument.record.record import Record
from tests.support.scans import changed, small_scan
from tests.support.stages.emulated_stages import EMULATED_STAGES, SLOW, EmulatedStage

DEADLINE_S = 10.0


def main() -> None:
    name, *causes = sys.argv[1:]
    for cause in causes:
        _stop(name, cause)


def _stop(name: str, how: str) -> None:
    stop_signals.begin()  # again for each scan: an earlier stop belonged to another command
    with EMULATED_STAGES[name](SLOW) as emulated, TemporaryDirectory() as folder:
        moment: list[float] = []
        threading.Thread(target=_interrupt, args=(emulated, how, moment), daemon=True).start()
        try:
            _scan(emulated, how, moment, Path(folder))
        except (KeyboardInterrupt, DeviceError) as error:
            sys.stdout.write(f"{type(error).__name__}\n")
        end_s = time.monotonic() + DEADLINE_S
        while not (stops := _stops(emulated, moment)):
            if time.monotonic() > end_s:
                raise SystemExit("no stop on the wire")
            time.sleep(0.001)
        sys.stdout.write(f"{stops[0] - moment[0]} {emulated.motor.moving}\n")


def _stops(emulated: EmulatedStage, moment: list[float]) -> list[float]:
    """Arrival times of stops after that moment."""
    return [
        at
        for at, data in emulated.wire.seen
        if moment and at >= moment[0] and emulated.kind.stop in data
    ]


def _interrupt(emulated: EmulatedStage, how: str, moment: list[float]) -> None:
    """Stop the scan once the stage is well under way."""
    while not (emulated.motor.moving and abs(emulated.motor.position_deg) > 3):
        time.sleep(0.001)
    moment.append(time.monotonic())
    if how != "exception":
        os.kill(os.getpid(), getattr(signal, how))


def _scan(emulated: EmulatedStage, how: str, moment: list[float], folder: Path) -> None:
    sweep = {"theta_i_deg": [60.0], "dphi_deg": [0.0], "theta_r_deg": [-70.0, 0.0]}
    loaded = changed(small_scan(shrink=10), sweeps=[sweep])
    devices = open_devices(loaded)
    stage = emulated.stage
    if how == "exception":
        stage = _Failing(stage, moment)  # type: ignore[assignment]  # a stand-in
    axis = Axis("theta_r", stage, loaded.rig.axes.theta_r, SystemClock())
    devices = replace(devices, axes={**devices.axes, "theta_r": axis})
    stops = {"theta_r": axis.stop}
    with Record.create(folder / "run", {}) as record, orderly_end(), stopped_by_signals(stops):
        Engine(loaded.protocol, loaded.rig, devices, record, lambda _: None).run(make_plan(loaded))


class _Failing:
    """A stage during whose move the scan fails."""

    def __init__(self, stage: object, moment: list[float]) -> None:
        self._stage, self._moment = stage, moment

    def wait(self) -> float:
        end_s = time.monotonic() + DEADLINE_S
        while not self._moment and time.monotonic() < end_s:
            self._stage.position_deg()  # type: ignore[attr-defined]  # a stand-in
        raise DeviceError("something else failed")

    def __getattr__(self, name: str) -> object:
        return getattr(self._stage, name)
