"""`gonio home`, `move` and `devices`."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from acquisition.commands import setup
from acquisition.engine.axis import Axis
from acquisition.rig import OpenRig
from instrument.clock import SystemClock
from instrument.config.load import load_rig
from instrument.errors import DeviceError, InputError, OperatorStop
from tests.support.command import gonio_here as gonio
from tests.support.paths import CONFIGS, ROOT
from tests.support.stages.emulated_stages import EMULATED_STAGES, SLOW
from tests.support.stages.waiting import wait_until

BENCH, PAPER = CONFIGS / "rigs" / "bench_12bit.yaml", CONFIGS / "rigs" / "paper_1995.yaml"


def test_an_axis_is_homed_and_moved() -> None:
    done = gonio("home", "theta_r", "--rig", BENCH)
    assert (done.returncode, done.stdout.strip()) == (0, "theta_r: stands at 0.0000 deg")
    done = gonio("move", "theta_r", "-20.5", "--rig", BENCH)
    assert (done.returncode, done.stdout.strip()) == (0, "theta_r: stands at -20.5000 deg")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("move", "theta_r", "88.5", "--rig", BENCH), "88.5 deg; allowed by .*: -88 to 88 deg"),
        (("move", "theta_r", "nan", "--rig", BENCH), "nan deg; allowed by"),
        (("move", "phi", "1", "--rig", BENCH), "'phi' is no axis; allowed: theta_i, dphi, theta_r"),
        (("home", "theta_i", "--rig", PAPER), "theta_i is set by hand on the rig paper_1995"),
        (("home", "theta_r"), "name the rig file: --rig FILE"),
        (("grab", "--rig", BENCH, "-o", "x.jpg"), r"x.jpg: --out must end in .png .* or .tiff"),
        (("move", "theta_r", "1", "--rig", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_mistakes_are_named_and_nothing_moves(arguments: tuple[object, ...], words: str) -> None:
    done = gonio(*arguments)
    assert done.returncode == 2
    assert re.search(words, done.stderr)
    assert "Traceback" not in done.stderr


REAL_RIG = """
name: real
beam_length_mm: 800.0
lamp_distance_mm: 1000.0
source_solid_angle_sr: 0.0005
receiver_solid_angle_sr: 0.0003
axes:
  theta_i: {driver: hand, min_deg: 0.0, max_deg: 85.0, u_deg: 0.25}
  dphi: {driver: hand, min_deg: 0.0, max_deg: 180.0, u_deg: 0.25}
  theta_r: {driver: newport, port: /dev/nowhere, min_deg: -88.0, max_deg: 88.0, u_deg: 0.02,
            speed_deg_per_s: 20.0, acceleration_deg_per_s2: 40.0, settle_s: 0.3}
camera: {driver: v4l2, device: /dev/nocamera, pixel_format: GREY, bit_depth: 8, width_px: 640,
         height_px: 480, field_width_mm: 72.0, axis_row_px: 240.0, axis_column_px: 320.0,
         full_well_electrons: 10000.0, read_noise_electrons: 10.0,
         dark_current_electrons_per_s: 20.0, black_level_dn: 8.0, min_exposure_s: 0.0001,
         max_exposure_s: 0.5, frame_overhead_s: 0.03}
lamp: {driver: manual, darkened_by: hand, white_electrons_per_s: 100000.0}
"""


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("number", "why"), [(signal.SIGHUP, "the terminal was closed"), (signal.SIGQUIT, "operator")]
)
def test_a_move_ends_with_a_closed_terminal(
    number: signal.Signals, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stage is a real driver over an emulated controller, and takes three seconds."""
    with EMULATED_STAGES["newport"](SLOW) as emulated:

        class Emulated(OpenRig):
            def axis(self, name: str) -> Axis:
                return Axis(name, emulated.stage, self._rig.axes[name], SystemClock())

        def strike() -> None:
            wait_until(lambda: emulated.motor.moving and emulated.motor.position_deg > 3)
            os.kill(os.getpid(), number)

        monkeypatch.setattr(setup, "OpenRig", Emulated)
        threading.Thread(target=strike).start()
        done = gonio("move", "theta_r", "60", "--rig", BENCH)
        assert done.returncode == 4, done.stderr
        assert why in done.stderr
        wait_until(lambda: not emulated.motor.moving)
        assert emulated.motor.position_deg < 55


@pytest.fixture
def real_rig(tmp_path: Path) -> Path:
    path = tmp_path / "real.yaml"
    path.write_text(REAL_RIG)
    return path


def test_a_real_rig_without_a_terminal_is_not_even_opened(real_rig: Path, tmp_path: Path) -> None:
    done = gonio("run", CONFIGS / "protocols" / "demo.yaml", "--rig", real_rig,
                 "--out", tmp_path / "run")  # fmt: skip
    assert done.returncode == 2
    assert "standard input is no terminal" in done.stderr
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("theta_i", "words"),
    [
        ("{driver: newport, port: /dev/nowhere, ", "both at /dev/nowhere, address 1; allowed: an"),
        ("{driver: zaber, port: /dev/nowhere, microsteps_per_deg: 100.0, ",
         "both at /dev/nowhere, with zaber and newport; allowed on one port: one driver"),
        ("{driver: newport, port: emulated, ", "axis theta_i is emulated, .*camera is real"),
        ("{driver: simulated, ", "axis theta_i is simulated, .*axis theta_r is real"),
    ],
)  # fmt: skip
def test_devices_that_do_not_go_together(real_rig: Path, theta_i: str, words: str) -> None:
    motor = "speed_deg_per_s: 1.0, acceleration_deg_per_s2: 1.0, settle_s: 0.1, "
    text = real_rig.read_text().replace("theta_i: {driver: hand, ", f"theta_i: {theta_i}{motor}")
    real_rig.write_text(text)
    with pytest.raises(InputError, match=words):
        load_rig(real_rig)


def test_a_missing_device_is_named_with_what_to_look_at(real_rig: Path) -> None:
    done = gonio("home", "theta_r", "--rig", real_rig, "--yes")
    assert done.returncode == 3
    assert re.search(r"theta_r: cannot open /dev/nowhere: .*look at the cable", done.stderr)
    done = gonio("devices", "--rig", real_rig)
    assert done.returncode == 3
    assert "theta_r: FAILED: theta_r: cannot open /dev/nowhere" in done.stdout
    assert "camera: FAILED:" in done.stdout
    assert "/dev/nocamera" in done.stdout


def at_terminal(arguments: list[object], replies: dict[str, str], until: str) -> str:
    """Run `gonio` on a pseudo-terminal, answering prompts; what it printed up to its end."""
    pid, master = pty.fork()
    if pid == 0:
        os.chdir(ROOT)
        os.execv(sys.executable, [sys.executable, "-m", "acquisition", *map(str, arguments)])
    text, end_s, waiting = "", time.monotonic() + 30, dict(replies)
    while time.monotonic() < end_s:
        if not select.select([master], [], [], 0.5)[0]:
            continue
        try:
            text += os.read(master, 4096).decode("utf-8", "replace")
        except OSError:
            break
        for prompt in [p for p in waiting if p in text]:
            os.write(master, waiting.pop(prompt).encode())
    os.close(master)  # hangs up on a child that still waits for an answer
    os.waitpid(pid, 0)
    assert until in text, text
    return text


class Lost:
    """An axis whose port is gone, and whose first stop is interrupted by a signal."""

    name = "theta_r"
    stops = 0

    def stop(self) -> None:
        self.stops += 1
        if self.stops == 1:
            raise KeyboardInterrupt
        raise DeviceError("theta_r: its port is gone")


def test_a_signal_while_a_lost_axis_is_stopped_keeps_the_warning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(setup, "reason", lambda: "stopped by the operator")
    words = "^stopped by the operator\nLOOK AT THE RIG FIRST: theta_r .* gone\ntheta_r: no answer"
    with (
        pytest.raises(OperatorStop, match=words),
        setup.stopped_at_an_error(Lost()),  # type: ignore[arg-type]  # a stand-in
    ):
        raise DeviceError("theta_r: no answer")


def test_nothing_real_moves_before_somebody_has_said_so(real_rig: Path) -> None:
    from tests.support.stages.emulated_stages import emulated

    with emulated("newport") as bench:
        text = real_rig.read_text().replace("/dev/nowhere", str(bench.wire.port))
        real_rig.write_text(text)
        bench.stage.close()
        said = at_terminal(["home", "theta_r", "--rig", real_rig], {"[y/N]": "n\n"}, "moved")
        assert "SMC100" in said
        assert not bench.motor.referenced
        at_terminal(["home", "theta_r", "--rig", real_rig], {"[y/N]": "y\n"}, "stands at 0.0000")
        assert bench.motor.referenced
        moved = gonio("move", "theta_r", "1.5", "--rig", real_rig, "--yes")
        assert "theta_r will move from 0.0000 to 1.5 deg" in moved.stderr
        homed = gonio("home", "theta_r", "--rig", real_rig, "--yes")
        assert "theta_r, found at 1.5000 deg, will look for its reference" in homed.stderr
