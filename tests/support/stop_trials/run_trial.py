"""One trial carried out: start, fault, signal, end, and where it is due the next start."""

from __future__ import annotations

import contextlib
import math
import shutil
import sqlite3
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

from drivers.lines import device_lock
from tests.support.stop_trials.bench import Bench
from tests.support.stop_trials.files import arguments, next_arguments, write_files
from tests.support.stop_trials.program import Program
from tests.support.stop_trials.trial import BEFORE_FIRST_S, ENDS_NO_PROGRAM, GOES_ON, ON_DISK, Trial

ENDS_WITHIN_S = 20.0  # after the signal, and after the fault has gone
_REST_S = 20.0  # for an axis whose program is frozen or dead
_GIVES_UP_S = 5.0  # for a scan that has lost the port
_NEXT_S = 3.0  # for the next motion of a scan whose disk hangs
_TICK_S = 0.02


@dataclass
class Seen:
    """What happened in a trial; times of the monotonic clock, in s.

    `struck_s`: the signal, or the fault where none was sent. `reachable_s`: from when on a stop
    could reach the controller and the program could send one. `at_end`: the devices' log when the
    program had ended; `at_rest`: once the axis stood, before the next start.
    """

    struck_s: float = math.nan
    reachable_s: float = math.nan
    strike_took_s: float = 0.0
    code: int | None = None
    ended_s: float = math.inf
    text: str = ""
    waits: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    at_end: dict[str, Any] = field(default_factory=dict)
    at_rest: dict[str, Any] = field(default_factory=dict)
    next_code: int | None = None
    next_text: str = ""
    next_found: dict[str, Any] = field(default_factory=dict)
    refused_text: str = ""


def run_trial(trial: Trial) -> Seen:
    """Carry out a trial in a folder of its own."""
    # No TemporaryDirectory: the end of any process forked from this one would remove it.
    folder = Path(tempfile.mkdtemp(prefix="gonio-stop-"))
    with contextlib.ExitStack() as opened:
        opened.callback(shutil.rmtree, folder, ignore_errors=True)
        bench = opened.enter_context(Bench(trial, folder / "port"))
        opened.callback(_remove_lock, bench.port)
        write_files(trial, folder, bench.port)
        errors = folder / "errors" if trial.fault == "dropped terminal" and trial.at_once else None
        program = Program(folder, arguments(trial, folder), trial.real_start, errors)
        opened.callback(program.close)
        return _Course(trial, folder, bench, program).run()


def _remove_lock(port: str) -> None:
    """Remove the file that a command started as a user starts it has locked for the port."""
    for folder in device_lock._FOLDERS:
        (folder / f"gonio-{quote(port.lower(), safe='')}.lock").unlink(missing_ok=True)


class _Course:
    """Course of one trial."""

    def __init__(self, trial: Trial, folder: Path, bench: Bench, program: Program) -> None:
        self._trial, self._folder, self._bench, self._program = trial, folder, bench, program
        self._seen, self._disk = Seen(), contextlib.ExitStack()

    def run(self) -> Seen:
        """Return what happened."""
        with self._disk:
            if self._await_moment():
                self._strike()
            self._await_end()
        self._go_on()
        return self._seen

    def _await_moment(self) -> bool:
        """Wait for the motion and the moment in it; False if the command has ended before."""
        begun = self._await_motion()
        if begun is not None:
            whole_s = begun["ends_s"] - begun["begun_s"]
            self._wait_until(begun["begun_s"] + self._trial.moment * whole_s)
        return self._program.code is None

    def _await_motion(self) -> dict[str, Any] | None:
        kind = "home" if self._trial.motion == "homing" else "move"
        number, until_s = self._trial.number, time.monotonic() + BEFORE_FIRST_S
        if self._trial.fault not in ON_DISK:
            return self._motion(kind, number, until_s)
        first = self._motion(kind, number, until_s)
        if first is not None and kind == "move":  # its reading is written during the next motion
            self._wait_until(first["ends_s"] - _TICK_S)
        self._hang()
        if kind == "home":
            return first
        return self._motion(kind, number + 1, time.monotonic() + _NEXT_S)

    def _motion(self, kind: str, number: int, until_s: float) -> dict[str, Any] | None:
        """Return the motion once it has begun, None if the command ends first."""
        while time.monotonic() < until_s and self._program.code is None:
            found = self._bench.ask("await motion", kind=kind, number=number, seconds=_TICK_S)
            if found is not None:
                return dict(found)
            self._program.look()
        return None

    def _wait_until(self, until_s: float) -> None:
        while (left_s := until_s - time.monotonic()) > 0:
            if self._program.code is not None:
                time.sleep(left_s)
            else:
                self._program.look(min(left_s, _TICK_S))

    def _strike(self) -> None:
        """Begin the fault and send the signal."""
        trial, seen = self._trial, self._seen
        begun_s = self._begin_fault()
        if trial.signal:
            if trial.fault in GOES_ON:
                ahead_s = min(trial.ahead_s, trial.seconds / 2)
            else:
                ahead_s = trial.ahead_s if trial.fault in ("noise", "lost answers") else 0.0
            self._wait_until(begun_s + ahead_s)
            seen.struck_s = self._program.strike(trial.signal)
        else:
            seen.struck_s = begun_s
        seen.reachable_s = max(seen.struck_s, self._end_fault(begun_s))

    def _begin_fault(self) -> float:
        trial, bench = self._trial, self._bench
        match trial.fault:
            case "lost byte" | "garbled byte":
                bench.ask(
                    "spoil", fault=trial.fault, at=trial.at, back=trial.back, times=trial.times
                )
            case "lost answers":
                bench.ask("lose answers", seconds=trial.seconds)
            case "noise":
                bench.ask("noise")
            case "unplugged":
                return float(bench.ask("unplug"))
            case "killed":
                return self._program.strike("SIGKILL")
            case "frozen" | "frozen for ever":
                return self._program.strike("SIGSTOP")
        return time.monotonic()

    def _end_fault(self, begun_s: float) -> float:
        """End a fault that ends by itself; return the time from which on a stop is possible."""
        trial = self._trial
        if trial.fault == "frozen":
            self._wait_until(begun_s + trial.seconds)
            return self._program.strike("SIGCONT")
        if trial.fault == "unplugged" and not math.isinf(trial.seconds):
            self._wait_until(begun_s + trial.seconds)
            return float(self._bench.ask("replug"))
        return begun_s

    def _hang(self) -> None:
        """Let the disk hang, or hold the record, from now on until the trial's seconds are over."""
        if self._trial.fault == "hung disk":
            hung = self._folder / "hung"
            hung.touch()
            self._disk.callback(hung.unlink)
        else:
            path = self._folder / "run" / "record.sqlite"
            other = sqlite3.connect(path, isolation_level=None, timeout=5.0)
            self._disk.callback(other.close)
            other.execute("BEGIN IMMEDIATE")
        self._hung_s = time.monotonic()

    def _await_end(self) -> None:
        trial, seen, program = self._trial, self._seen, self._program
        if trial.fault == "frozen for ever":
            self._refused()
            program.strike("SIGKILL")
        elif trial.fault in ON_DISK:
            self._wait_until(self._hung_s + trial.seconds)
            self._disk.close()
        if not trial.signal and trial.command == "run" and trial.fault in GOES_ON:
            after_s = trial.ahead_s if trial.fault == "frozen" else _GIVES_UP_S
            if not program.await_end(seen.reachable_s + after_s):  # the scan goes on
                seen.struck_s = seen.reachable_s = program.strike("SIGTERM")
        program.await_end(time.monotonic() + ENDS_WITHIN_S)
        seen.code, seen.ended_s, seen.text = program.code, program.ended_s, program.text
        seen.waits, seen.strike_took_s = program.waits, program.strike_took_s
        seen.at_end = self._bench.ask("log")

    def _refused(self) -> None:
        """Start a second command while the first is frozen."""
        self._seen.refused_text = self._start_again()[1]

    def _go_on(self) -> None:
        """Let the axis come to rest, and start again where the program was frozen or killed."""
        trial, seen = self._trial, self._seen
        if trial.fault not in ENDS_NO_PROGRAM or math.isnan(seen.struck_s):
            seen.at_rest = seen.at_end
            return
        if trial.at_once:
            seen.next_found = self._bench.ask("log")
            seen.next_code, seen.next_text = self._start_again()
        self._await_rest()
        seen.at_rest = self._bench.ask("log")
        if not trial.at_once:
            seen.next_found = seen.at_rest
            seen.next_code, seen.next_text = self._start_again()

    def _await_rest(self) -> None:
        until_s = time.monotonic() + _REST_S
        while self._bench.ask("log")["moving"] and time.monotonic() < until_s:
            time.sleep(0.05)

    def _start_again(self) -> tuple[int | None, str]:
        """Run the command with which a person would go on; a scan is stopped once it moves."""
        before = len(self._bench.ask("log")["motions"])
        arguments = next_arguments(self._trial, self._folder)
        again = Program(self._folder, arguments, self._trial.real_start)
        try:
            until_s = time.monotonic() + ENDS_WITHIN_S
            while self._trial.command == "run" and not again.await_end(time.monotonic() + 0.1):
                begun = self._bench.ask("log")["motions"][before:]
                if time.monotonic() > until_s or any(m["kind"] != "brake" for m in begun):
                    again.strike("SIGTERM")
                    break
            again.await_end(time.monotonic() + ENDS_WITHIN_S)
            return again.code, again.text
        finally:
            again.close()
