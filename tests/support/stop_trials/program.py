"""The command `gonio` at a terminal of its own, as a process that a trial strikes.

Most are forked from a process that has imported everything, and then call the entry point of the
script `gonio`; a share is started as a user starts it.
"""

from __future__ import annotations

import atexit
import fcntl
import importlib
import os
import select
import signal
import sys
import termios
import threading
import time
import tomllib
import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import acquisition.commands.scan_session
import acquisition.commands.setup
import acquisition.results.finish
import drivers.lines.modbus_bus
import drivers.stages.newport
import drivers.stages.oriental
import drivers.stages.zaber
import sim.scene.camera
import sim.scene.stage
from acquisition.engine.axis import Axis
from acquisition.engine.engine import Devices
from acquisition.rig import open_devices
from drivers.factory import Lines, open_stage
from drivers.lines import device_lock
from instrument.clock import SystemClock
from instrument.config.axes import HandAxis, SimulatedAxis
from instrument.config.load import Loaded, load_rig
from sim.faults.faults import Faults
from tests.support.paths import ROOT
from tests.support.stop_trials.files import rig_file

HUNG_DISK = "GONIO_HUNG_DISK"
_STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_PREPARED = (
    acquisition.commands.setup, acquisition.results.finish, drivers.lines.modbus_bus,
    drivers.stages.newport, drivers.stages.oriental, drivers.stages.zaber, sim.scene.camera,
    sim.scene.stage,
)  # fmt: skip


class Program:
    """One run of the command; `text`: everything it has said at its terminal or on `errors`.

    `waits`: times, and for how long each of its threads had until then been ready to run without a
    processor, in s. `strike_took_s`: the signal was sent within this time from the one returned.
    """

    def __init__(
        self, folder: Path, arguments: Sequence[str], real_start: bool, errors: Path | None = None
    ) -> None:
        self._terminal, slave = os.openpty()
        self._text, self._errors = b"", errors
        self.code: int | None = None
        self.ended_s = float("inf")
        self.strike_took_s = 0.0
        self.waits: list[tuple[float, dict[str, float]]] = []
        self.pid = os.fork()
        if self.pid == 0:
            _become(folder, arguments, real_start, slave, errors)
        os.close(slave)
        self._exit = os.pidfd_open(self.pid)

    @property
    def text(self) -> str:
        errors = self._errors.read_bytes() if self._errors and self._errors.exists() else b""
        return (self._text + errors).decode("utf-8", "replace")

    def strike(self, name: str) -> float:
        """Send a signal, or drop the terminal; return the time."""
        self.look()
        struck_s = time.monotonic()
        if name == "terminal":
            self._drop_terminal()
        elif self.code is None:
            os.kill(self.pid, getattr(signal, name))
        self.strike_took_s = time.monotonic() - struck_s
        return struck_s

    def await_end(self, until_s: float) -> bool:
        """Read what the command says until it ends; False if it does not in time."""
        while self.code is None and (left_s := until_s - time.monotonic()) > 0:
            self.look(min(left_s, 0.05))
        return self.code is not None

    def look(self, seconds: float = 0.0) -> None:
        """Read what the command has said, for up to so long, and whether it has ended."""
        if self.code is not None:
            return
        open_ends = [self._exit, *([self._terminal] if self._terminal >= 0 else [])]
        ready, _, _ = select.select(open_ends, [], [], seconds)
        self._note_waits()
        if self._terminal in ready:
            self._read()
        if self._exit in ready:
            self.ended_s = time.monotonic()
            _, status = os.waitpid(self.pid, 0)
            self.code = os.waitstatus_to_exitcode(status)
            self._read_rest()

    def close(self) -> None:
        """Kill the command if it still runs."""
        if self.code is None:
            os.kill(self.pid, signal.SIGKILL)
            self.await_end(time.monotonic() + 10.0)
        self._drop_terminal()
        os.close(self._exit)

    def _read(self) -> bool:
        try:
            data = os.read(self._terminal, 65536)
        except OSError:  # nobody holds its other end
            data = b""
        self._text += data
        return bool(data)

    def _read_rest(self) -> None:
        while self._terminal >= 0 and select.select([self._terminal], [], [], 0)[0]:
            if not self._read():
                return

    def _drop_terminal(self) -> None:
        terminal, self._terminal = self._terminal, -1
        if terminal >= 0:
            os.close(terminal)

    def _note_waits(self) -> None:
        waits = dict(self.waits[-1][1]) if self.waits else {}  # those of ended threads stay
        for thread in Path(f"/proc/{self.pid}/task").glob("*"):
            try:
                waits[thread.name] = int((thread / "schedstat").read_text().split()[1]) * 1e-9
            except (OSError, IndexError):
                continue
        self.waits.append((time.monotonic(), waits))


def _become(
    folder: Path, arguments: Sequence[str], real_start: bool, slave: int, errors: Path | None
) -> None:
    """Be the command, in the process just forked; does not return."""
    code = 70
    try:
        os.setsid()
        fcntl.ioctl(slave, termios.TIOCSCTTY, 0)
        for number in range(3):
            os.dup2(slave, number)
        if errors is not None:
            os.dup2(os.open(errors, os.O_WRONLY | os.O_CREAT | os.O_APPEND), 2)
        os.closerange(3, 256)
        os.chdir(ROOT)
        os.environ[HUNG_DISK] = str(folder / "hung")
        for number in _STOPS:
            signal.signal(number, signal.SIG_DFL)
        if real_start:
            os.execv(sys.executable, [sys.executable, "-m", "acquisition", *arguments])
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = _run(folder, arguments)
    finally:  # the parent's code must never go on here
        if code == 70:
            os.write(2, traceback.format_exc().encode())
        os._exit(code)


def _run(folder: Path, arguments: Sequence[str]) -> int:
    """Call the entry point; end as the interpreter does."""
    for number, mode in enumerate("rww"):
        name = ("stdin", "stdout", "stderr")[number]
        stream = os.fdopen(number, mode, buffering=1, encoding="utf-8", closefd=False)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    sys.argv = ["gonio", *arguments]
    device_lock._FOLDERS = (folder,)
    _open_axis(rig_file(folder))
    code = 0
    try:
        entry_point()()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001 - as the interpreter prints it
        traceback.print_exc()
        code = 1
    threading._shutdown()  # type: ignore[attr-defined]  # as at the end of a script
    atexit._run_exitfuncs()
    return code


def entry_point() -> object:
    """Return the function behind the script `gonio`."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, _, name = scripts["gonio"].partition(":")
    return getattr(importlib.import_module(module), name)


class _SeenAxis(Axis):
    """Axis that the simulated scene follows."""

    faults: Faults

    def home(self) -> None:
        super().home()
        self._show()

    def finish_move(self) -> None:
        super().finish_move()
        self._show()

    def homed(self) -> bool:
        known = super().homed()
        if known:
            self._show()
        return known

    def _show(self) -> None:
        assert self.faults.scene is not None
        self.faults.scene.set_axis("theta_r", self.position_deg())


def _open_axis(path: Path) -> None:
    """Let a scan, all of whose other devices are simulated, open the real axis of a rig file."""

    def opening(loaded: Loaded) -> Devices:
        settings = load_rig(path).axes.theta_r
        assert not isinstance(settings, HandAxis | SimulatedAxis)
        faults, clock = Faults(), SystemClock()
        devices, lines = open_devices(loaded, faults), Lines(clock)
        try:
            stage = open_stage("theta_r", settings, settings.port, lines)
        except BaseException:
            lines.close()
            raise
        axis = _SeenAxis("theta_r", stage, settings, clock)
        axis.faults, close = faults, devices.close

        def close_all() -> None:
            stage.close()
            lines.close()
            close()

        return replace(devices, axes={**devices.axes, "theta_r": axis}, close=close_all)

    acquisition.commands.scan_session.open_devices = opening
