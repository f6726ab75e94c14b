"""A stop under single faults, on emulated devices in a process of their own that outlives ours.

The axis stands within half a second and its braking time, or a line says that it may not; a frozen
or killed program lets it end its move, and the next start says so.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from tests.support.paths import ROOT
from tests.support.stop_trials.run_trial import Seen
from tests.support.stop_trials.trial import CONTROLLERS, FAULTS, draw
from tests.support.stop_trials.verdict import verdict

FIRST = 12  # seeds that draw each fault once
IN_FULL = 1000
DEADLINE_S = 7200.0


def tree_of(seeds: str, at_once: int, out: Path) -> str:
    """Run the trials of these seeds and return their table, which ends with the exceptions."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: no disk can be made to hang (Debian: gcc, libc6-dev)")
    command = ["-m", "tests.support.stop_trials", "--seeds", seeds, "--at-once", str(at_once)]
    done = subprocess.run(
        [sys.executable, *command, "--out", str(out)], cwd=ROOT, capture_output=True, text=True,
        timeout=DEADLINE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{done.stdout}{done.stderr[-3000:]}"
    return done.stdout


@pytest.mark.waits
def test_each_fault_once(tmp_path: Path) -> None:
    tree_of(f"0:{FIRST}", FIRST, tmp_path / "outcomes")


@pytest.mark.slow
def test_the_whole_tree_of_faults(
    slow: bool, tmp_path: Path, record_testsuite_property: Callable[[str, object], None]
) -> None:
    """The bounded form counts what would be tried: each branch, and each controller on it."""
    trials = [draw(seed) for seed in range(IN_FULL)]
    branches = Counter((t.fault, t.motion, t.controller) for t in trials)
    for fault, motion in product(set(FAULTS), ("moving", "homing")):
        assert all(branches[fault, motion, c] for c in CONTROLLERS if fault != "noise"), fault
    if slow:
        tree = tree_of(f"0:{IN_FULL}", 12, tmp_path / "outcomes")
        record_testsuite_property("stops under single faults", tree)


def motion(kind: str, begun_s: float, ends_s: float) -> dict[str, Any]:
    return {"kind": kind, "begun_s": begun_s, "ends_s": ends_s, "from_deg": 0.0, "to_deg": 0.0}


STOPPED_LATE = [motion("home", 0.0, 9.0), motion("brake", 5.8, 6.0)]


def seen(motions: list[dict[str, Any]], text: str, **more: Any) -> Seen:
    """What a trial saw that was struck at 5 s."""
    log = {"motions": motions, "moving": False, "late": [], "position_deg": 0.0}
    found = {"struck_s": 5.0, "reachable_s": 5.0, "code": 4, "at_end": log, "at_rest": log}
    return Seen(text=text, **(found | more))


def waits(*waited_s: float) -> list[tuple[float, dict[str, float]]]:
    """Waits of the program's thread before the strike, in the stop and after it."""
    return [(at_s, {"1": s}) for at_s, s in zip((4.9, 5.7, 6.1), waited_s, strict=True)]


TRIAL = replace(draw(0), command="home", motion="homing", fault="none", signal="SIGINT")


def test_a_late_stop_on_a_busy_machine_proves_nothing() -> None:
    late = seen(STOPPED_LATE, "", waits=waits(0.1, 0.5, 0.6))
    assert verdict(TRIAL, late).how == "busy"


@pytest.mark.parametrize(
    ("what", "exception"),
    [
        (seen([motion("home", 0.0, 9.0), motion("brake", 5.3, 5.6)], ""), ""),
        (seen(STOPPED_LATE, "stopped by the operator"), "stood after 1.00 s"),
        (seen(STOPPED_LATE, "LOOK AT THE RIG FIRST: theta_r: may still move"), ""),
        (seen(STOPPED_LATE, "", waits=waits(0.1, 0.3, 0.5)), ""),
        (seen(STOPPED_LATE, "", waits=waits(0.1, 0.1, 0.2)), "waited 0.10 s"),
        (seen([motion("home", 0.0, 5.2)], "Traceback"), "traceback"),
        (seen([motion("home", 0.0, 5.2)], "", code=130), "exit code 130"),
        (seen([motion("home", 0.0, 5.2)], "", code=None), "did not end"),
        (seen([motion("move", 0.0, 5.2)], ""), ""),
        (seen([{**motion("move", 0.0, 5.2), "to_deg": 44.0}], ""), "not asked for"),
        (seen([{**motion("move", 0.0, 5.2), "to_deg": 91.0}], ""), "beyond the limits"),
    ],
)
def test_a_verdict_finds_what_is_wrong(what: Seen, exception: str) -> None:
    found = verdict(TRIAL, what).exceptions
    assert bool(found) == bool(exception)
    assert exception in "".join(found)


def test_a_claim_that_motion_has_ended_is_checked() -> None:
    what = seen([motion("home", 0.0, 9.0), motion("brake", 5.3, 5.6)], "all motion has ended")
    what.at_end = {**what.at_end, "moving": True}
    assert "moves when the command has said" in "".join(verdict(TRIAL, what).exceptions)


def test_a_claim_about_an_axis_that_could_not_be_read_is_an_exception() -> None:
    what = seen([motion("home", 0.0, 9.0), motion("brake", 5.3, 5.6)], "all motion has ended")
    for_ever = replace(TRIAL, fault="lost answers", seconds=float("inf"))
    assert "cannot have read" in "".join(verdict(for_ever, what).exceptions)
    assert not verdict(TRIAL, what).exceptions
