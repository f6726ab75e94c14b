"""Terminal output shared by all commands: consoles, prompts, durations and the progress bar."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from acquisition.plan.plan import Plan, Step
from acquisition.terminal.layout import note_lines, wrapped
from acquisition.terminal.streams import HANDLER
from instrument.text.terminal_safe import escape_control_characters


class EscapingConsole(Console):
    """Console that prints strings literally: no markup, control characters escaped."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return the text with its control characters escaped, in characters of the terminal."""
        shown = escape_control_characters(text).encode(self.encoding, HANDLER)
        return super().render_str(shown.decode(self.encoding), **options)


_WIDE = 60  # characters that hold a bar beside the numbers of a scan

# Progress and prompts go to standard error: standard output may be JSON.
console = EscapingConsole(stderr=True, markup=False, emoji=False)
out = EscapingConsole(markup=False, emoji=False)


def print_lines(lines: Iterable[str]) -> None:
    """Print lines that are laid out for the width of standard output, which is `out.width`."""
    for line in lines:
        out.print(line, highlight=False, soft_wrap=True)


def print_text(text: str) -> None:
    """Print a paragraph on standard output."""
    print_lines(wrapped(text, out.width))


def print_notes(notes: Iterable[str]) -> None:
    """Print notes as a list on standard output, those that are empty left out."""
    for note in filter(None, notes):
        print_lines(note_lines(note, out.width))


def ask(question: str) -> str:
    """Print a question and return the stripped answer; raise `EOFError` at the end of input."""
    console.print(question, end=" ", highlight=False, soft_wrap=True)
    return console.input("").strip()


class _Shown(logging.Handler):
    """Prints each message at once."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message, from any thread."""
        console.print(record.getMessage(), highlight=False, soft_wrap=True)


@contextmanager
def warnings_shown(logger: str) -> Iterator[None]:
    """Print what is logged under this name, within a `with` block: a person has to act on it."""
    handler = _Shown(logging.WARNING)
    logging.getLogger(logger).addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger(logger).removeHandler(handler)


def duration_text(seconds: float) -> str:
    """Return a duration as hours and minutes, minutes and seconds, or seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextmanager
def progress_bar(plan: Plan, done: frozenset[int]) -> Iterator[Callable[[Step], None]]:
    """Show a bar over the planned time; yield the function to call after each accepted step.

    `done`: indices of the steps accepted before, by the run that is being resumed.
    """
    pose, count = TextColumn("{task.description:30}"), TextColumn("{task.fields[count]}")
    left = (TextColumn("time left"), TimeRemainingColumn(compact=True))
    # In a narrow terminal the numbers stay whole, and what is less needed goes.
    columns = (pose, BarColumn(), count, *left) if console.width >= _WIDE else (pose, count)
    accepted, total = len(done), len(plan.steps)
    planned_s = sum(step.duration_s for step in plan.steps)
    start_s = int(sum(step.duration_s for step in plan.steps if step.index in done))
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(
            "homing, darks", total=planned_s, completed=start_s, count=f"{accepted}/{total}"
        )

        def on_step(step: Step) -> None:
            nonlocal accepted
            accepted += 1
            count = f"{accepted}/{total}"
            bar.update(task, advance=step.duration_s, description=_step_text(step), count=count)

        yield on_step


def _step_text(step: Step) -> str:
    kind = {"point": "", "tile": "white tile ", "drift": "drift check "}[step.kind]
    return f"{kind}θ_i {step.pose.theta_i:g}° θ_r {step.pose.theta_r:g}°"
