"""Progress of what takes long: a bar in a terminal, lines in a pipe or a log."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from acquisition.plan.plan import Plan, Step
from acquisition.plan.step_count import StepCount
from acquisition.terminal.console import console, duration_text
from instrument.text.terminal_safe import escape_control_characters

QUIET_S = 2.0  # what is done sooner needs no sign of life
_WIDE = 60  # characters that hold a bar beside the numbers of a scan

OnStep = Callable[[Step], None]


@contextmanager
def scan_progress(plan: Plan, done: frozenset[int]) -> Iterator[OnStep]:
    """Show how far a scan is; yield the function to call after each accepted step.

    `done`: indices of the steps accepted before, by the run that is being resumed.
    """
    counted = StepCount(plan, done)
    if console.is_interactive:
        with _bar(counted) as on_step:
            yield on_step
    else:
        yield lambda step: _print(_line(counted, step))


def _line(counted: StepCount, step: Step) -> str:
    """Count an accepted step and return its line in a log."""
    counted.add(step)
    left = " of those chosen" if counted.growing else ""
    return f"{counted.text} {_step_text(step)}, {duration_text(counted.left_s)} left{left}"


def _print(line: str) -> None:
    sys.stderr.write(f"{line}\n")


@contextmanager
def _bar(counted: StepCount) -> Iterator[OnStep]:
    """Show a bar over the planned time."""
    pose, count = TextColumn("{task.description:30}"), TextColumn("{task.fields[count]}")
    left = (TextColumn("time left"), TimeRemainingColumn(compact=True))
    # In a narrow terminal the numbers stay whole, and what is less needed goes.
    columns = (pose, BarColumn(), count, *left) if console.width >= _WIDE else (pose, count)
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(
            "homing, darks",
            total=counted.planned_s,
            completed=int(counted.accepted_s),
            count=counted.text,
        )

        def on_step(step: Step) -> None:
            counted.add(step)
            text = _step_text(step)
            bar.update(
                task, completed=counted.accepted_s, total=counted.planned_s, description=text,
                count=counted.text,
            )  # fmt: skip

        yield on_step


def _step_text(step: Step) -> str:
    kind = {"point": "", "tile": "white tile ", "drift": "drift check "}[step.kind]
    return f"{kind}θ_i {step.pose.theta_i:g}° θ_r {step.pose.theta_r:g}°"


@contextmanager
def sign_of_life(task: str) -> Iterator[None]:
    """Show that a task is under way once it has taken QUIET_S, within a `with` block.

    In a terminal its time runs; in a log a line follows when the time has doubled.
    """
    done = threading.Event()
    shows = _show_running if console.is_interactive else _log_running
    thread = threading.Thread(target=_after_quiet, args=(shows, task, done), daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


Show = Callable[[str, float, threading.Event], None]


def _after_quiet(show: Show, task: str, done: threading.Event) -> None:
    begun_s = time.monotonic()
    if not done.wait(QUIET_S):
        show(task, begun_s, done)


def _show_running(task: str, begun_s: float, done: threading.Event) -> None:
    with console.status(task, spinner="line", refresh_per_second=2) as status:
        while not done.wait(1.0):
            status.update(f"{task}: {duration_text(time.monotonic() - begun_s)}")


def _log_running(task: str, begun_s: float, done: threading.Event) -> None:
    pause_s = QUIET_S
    while True:
        _print(f"{task}: {duration_text(time.monotonic() - begun_s)} so far")
        if done.wait(pause_s):
            return
        pause_s *= 2


OnDone = Callable[[str, bool], None]


@contextmanager
def counted_progress(total: int, done: str) -> Iterator[OnDone]:
    """Show how many of `total` items are done; yield the function to call after each.

    It takes the line about the item and whether it failed. In a terminal a counter runs, named
    `done`, such as "fitted"; in a log each item has its line.
    """
    if not console.is_interactive:
        numbers = iter(range(1, total + 1))
        yield lambda line, _: _print(escape_control_characters(f"{next(numbers)}/{total} {line}"))
        return
    count, left = TextColumn("{task.description}"), TimeRemainingColumn(compact=True)
    columns = (count, BarColumn(), left) if console.width >= _WIDE else (count,)
    with Progress(*columns, console=console) as bar:
        failures = [0]
        task = bar.add_task(f"0 of {total} {done}", total=total)

        def on_done(_: str, failed: bool) -> None:
            failures[0] += failed
            bar.advance(task)
            text = f"{bar.tasks[0].completed:.0f} of {total} {done}"
            bar.update(task, description=text + f", {failures[0]} failed" * bool(failures[0]))

        yield on_done
