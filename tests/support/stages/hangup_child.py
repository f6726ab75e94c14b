"""The command `gonio run` with one real driver over an emulated controller, for `test_hangup`.

`python -m tests.support.stages.hangup_child PIPE FOLDER [disk | record]`: a session of its own
whose controlling terminal is standard input, if that is one. Writes to the pipe, a line each:
`moving` once the axis is well under way; at the end, as JSON, the exit code, the arrivals of stops
on the wire, whether the motor still moves and whether the lamp is lit.

`disk`, `record`: the disk hangs, or another program holds the record, for ever from the second move
on, and the line comes in that move. The disk needs `storage/hung_disk.c`.
"""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import sys
import termios
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import acquisition.commands.scan_session
from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.entry import main
from acquisition.rig import open_devices
from instrument.clock import SystemClock
from instrument.config.load import Loaded
from sim.faults.faults import Faults
from tests.support.stages.emulated_stages import EMULATED_STAGES, SLOW, EmulatedStage
from tests.support.stages.waiting import wait_until

PROTOCOL = """\
name: hangup
rig: {rig}
sample: {{name: foam, width_mm: 50.0, height_mm: 50.0}}
sweeps:
  - {{theta_i_deg: [60.0], dphi_deg: [0.0], theta_r_deg: [-70.0, 70.0]}}
window: {{width_mm: 20.0, height_mm: 20.0}}
simulated_sample: {{model: lambert, parameters: {{albedo: 0.8}}}}
"""


class _SeenAxis(Axis):
    """Axis that the simulated scene follows; the record hangs with its move to a positive angle."""

    faults: Faults
    hang: Callable[[], None]

    def finish_move(self) -> None:
        super().finish_move()
        assert self.faults.scene is not None
        self.faults.scene.set_axis("theta_r", self.position_deg())

    def start_move(self, angle_deg: float) -> None:
        super().start_move(angle_deg)
        if angle_deg > 0:
            self.hang()


def run(pipe: int, folder: Path, hangs: str) -> None:
    faults, hung = Faults(), threading.Event()

    def hang() -> None:
        if hangs == "disk":
            Path(os.environ["GONIO_HUNG_DISK"]).touch()
        if hangs == "record":
            other = sqlite3.connect(folder / "run" / "record.sqlite", isolation_level=None)
            other.execute("BEGIN IMMEDIATE")
            held.append(other)
        hung.set()

    held: list[sqlite3.Connection] = []
    if not hangs:
        hung.set()
    with EMULATED_STAGES["newport"](SLOW) as emulated:

        def opening(loaded: Loaded) -> Devices:
            devices = open_devices(loaded, faults)
            axis = _SeenAxis("theta_r", emulated.stage, loaded.rig.axes.theta_r, SystemClock())
            axis.faults, axis.hang = faults, hang
            return replace(devices, axes={**devices.axes, "theta_r": axis})

        acquisition.commands.scan_session.open_devices = opening
        threading.Thread(target=_announce, args=(pipe, emulated, hung), daemon=True).start()
        sys.argv = ["gonio", "run", str(folder / "protocol.yaml"), "--out", str(folder / "run")]
        code: object = None
        try:
            main()
        except SystemExit as end:
            code = end.code
        stops = [at_s for at_s, data in emulated.wire.seen if emulated.kind.stop in data]
        assert faults.scene is not None
        _say(pipe, json.dumps([code, stops, emulated.motor.moving, faults.scene.lit]))


def _announce(pipe: int, emulated: EmulatedStage, hung: threading.Event) -> None:
    hung.wait()
    begun_deg = emulated.motor.position_deg
    wait_until(lambda: emulated.motor.moving, 60.0)
    wait_until(lambda: abs(emulated.motor.position_deg - begun_deg) > 3, 60.0)
    _say(pipe, "moving")


def _say(pipe: int, text: str) -> None:
    os.write(pipe, f"{text}\n".encode())


if __name__ == "__main__":
    if os.isatty(0):
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    run(int(sys.argv[1]), Path(sys.argv[2]), "".join(sys.argv[3:]))
