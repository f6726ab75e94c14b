"""Terminal output shared by all commands: consoles, prompts, paragraphs and durations."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.text import Text

from acquisition.terminal.keys import line_typed
from acquisition.terminal.layout import note_lines, wrapped
from acquisition.terminal.streams import HANDLER
from instrument.text.terminal_safe import escape_control_characters


class EscapingConsole(Console):
    """Console that prints strings literally: no markup, control characters escaped."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return the text with its control characters escaped, in characters of the terminal."""
        shown = escape_control_characters(text).encode(self.encoding, HANDLER)
        return super().render_str(shown.decode(self.encoding), **options)


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
    with line_typed():  # before the question: an answer may come at once
        console.print(question, end=" ", highlight=False, soft_wrap=True)
        return console.input("").strip()


class _Shown(logging.Handler):
    """Prints each message at once."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print a message, from any thread."""
        console.print(record.getMessage(), highlight=False, soft_wrap=True)


@contextmanager
def warnings_shown(*names: str) -> Iterator[None]:
    """Print what is logged under these names, within a `with` block: a person has to act on it."""
    handler, loggers = _Shown(logging.WARNING), [logging.getLogger(name) for name in names]
    for logger in loggers:
        logger.addHandler(handler)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeHandler(handler)


def duration_text(seconds: float) -> str:
    """Return a duration as hours and minutes, minutes and seconds, or seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
