"""Progress of a scan and of a fit, in a terminal and in a log."""

from __future__ import annotations

import re
import sys
import threading

import pytest

from acquisition.plan.plan import make_plan
from acquisition.terminal import progress
from acquisition.terminal.console import console, duration_text
from acquisition.terminal.progress import counted_progress, scan_progress, sign_of_life
from instrument.config.load import Loaded
from tests.support.stages.waiting import wait_until


def in_terminal(monkeypatch: pytest.MonkeyPatch, terminal: bool) -> None:
    monkeypatch.setattr(console, "_force_terminal", terminal)
    monkeypatch.setattr(console, "is_interactive", terminal)


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_counts_the_steps_accepted_before_a_resume(
    terminal: bool,
    demo: Loaded,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    plan = make_plan(demo)
    in_terminal(monkeypatch, terminal)
    with scan_progress(plan, frozenset({0, 1})) as on_step:
        on_step(plan.steps[2])
    assert f"3/{len(plan.steps)}" in capsys.readouterr().err


def test_a_log_has_one_plain_line_for_each_point(
    demo: Loaded, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = make_plan(demo)
    with scan_progress(plan, frozenset()) as on_step:
        for step in plan.steps:
            on_step(step)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(plan.steps)
    for number, (line, step) in enumerate(zip(lines, plan.steps, strict=True), start=1):
        assert line.startswith(f"{number}/{len(plan.steps)} ")
        assert f"θ_i {step.pose.theta_i:g}° θ_r {step.pose.theta_r:g}°, " in line
        assert re.fullmatch(r"[ -~θ°]+ left", line)
    assert lines[-1].endswith(", 0 s left")
    first_s = sum(step.duration_s for step in plan.steps[1:])
    assert lines[0].endswith(f", {duration_text(first_s)} left")


@pytest.mark.parametrize("width", range(40, 201, 10))
def test_progress_is_whole_in_a_narrow_terminal(
    width: int, demo: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bar, and the time left, go before any number does."""
    plan = make_plan(demo)
    monkeypatch.setattr(console, "_width", width)
    in_terminal(monkeypatch, True)
    with console.capture() as shown, scan_progress(plan, frozenset()) as on_step:
        for step in plan.steps[:9]:
            on_step(step)
    last = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.get()).split()
    pose = plan.steps[8].pose
    assert f"9/{len(plan.steps)}" in last
    assert f"θ_i {pose.theta_i:g}° θ_r {pose.theta_r:g}°" in " ".join(last)
    assert "…" not in shown.get()


@pytest.mark.parametrize("terminal", [True, False])
def test_a_task_that_takes_long_gives_a_sign_of_life(
    terminal: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "QUIET_S", 0.01)
    in_terminal(monkeypatch, terminal)
    written = threading.Event()
    err = sys.stderr

    class Noticed:
        """Standard error that notes when the task is named."""

        def write(self, text: str) -> int:
            if "fit" in text:
                written.set()
            return err.write(text)

        def __getattr__(self, name: str) -> object:
            return getattr(err, name)

    monkeypatch.setattr(sys, "stderr", Noticed())
    with sign_of_life("fit"):
        wait_until(written.is_set)
    assert "fit" in capsys.readouterr().err


def test_a_task_that_is_quick_gives_none(capsys: pytest.CaptureFixture[str]) -> None:
    before = threading.active_count()
    for error in (None, KeyboardInterrupt):
        try:
            with sign_of_life("fit"):
                if error is not None:
                    raise error
        except KeyboardInterrupt:
            pass
    assert capsys.readouterr().err == ""
    assert threading.active_count() == before


@pytest.mark.parametrize("width", range(30, 121, 10))
def test_a_counter_of_what_is_done_and_failed_runs_in_a_terminal(
    width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console, "_width", width)
    in_terminal(monkeypatch, True)
    with console.capture() as shown, counted_progress(300, "fitted") as on_done:
        for n in range(200):
            on_done(f"{n}.csv: lambert, adequate", n % 50 == 0)
    last = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.get()).split("\n")[-2]
    assert "200 of 300 fitted, 4 failed" in last


def test_a_log_has_one_line_for_each_item_without_control_characters(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with counted_progress(2, "fitted") as on_done:
        on_done("a\x1b[2J.csv: lambert, adequate", False)
        on_done("b.csv: missing column", True)
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith("1/2 a")
    assert "\x1b" not in first
    assert second == "2/2 b.csv: missing column"
