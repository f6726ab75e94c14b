"""The command `gonio run` with one real driver over an emulated controller, for `test_hangup`.

`python -m tests.support.stages.hangup_child PIPE FOLDER`: a session of its own whose controlling
terminal is standard input, if that is one. Writes to the pipe, a line each: `moving` once the axis
is well under way; at the end, as JSON, the exit code, the arrivals of stops on the wire, whether
the motor still moves and whether the lamp is lit.
"""

from __future__ import annotations

import fcntl
import json
import os
import sys
import termios
import threading
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


def run(pipe: int, folder: Path) -> None:
    faults = Faults()
    with EMULATED_STAGES["newport"](SLOW) as emulated:

        def opening(loaded: Loaded) -> Devices:
            devices = open_devices(loaded, faults)
            axis = Axis("theta_r", emulated.stage, loaded.rig.axes.theta_r, SystemClock())
            return replace(devices, axes={**devices.axes, "theta_r": axis})

        acquisition.commands.scan_session.open_devices = opening
        threading.Thread(target=_announce, args=(pipe, emulated), daemon=True).start()
        sys.argv = ["gonio", "run", str(folder / "protocol.yaml"), "--out", str(folder / "run")]
        code: object = None
        try:
            main()
        except SystemExit as end:
            code = end.code
        stops = [at_s for at_s, data in emulated.wire.seen if emulated.stop in data]
        assert faults.scene is not None
        _say(pipe, json.dumps([code, stops, emulated.motor.moving, faults.scene.lit]))


def _announce(pipe: int, emulated: EmulatedStage) -> None:
    wait_until(lambda: emulated.motor.moving and abs(emulated.motor.position_deg) > 3, 60.0)
    _say(pipe, "moving")


def _say(pipe: int, text: str) -> None:
    os.write(pipe, f"{text}\n".encode())


if __name__ == "__main__":
    if os.isatty(0):
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    run(int(sys.argv[1]), Path(sys.argv[2]))
