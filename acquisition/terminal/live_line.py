"""Line that changes while something is watched; in a log, lines that grow rarer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from acquisition.terminal.console import console


@contextmanager
def live_line(task: str) -> Iterator[Callable[[str], None]]:
    """Yield the function to call with each new text, within a `with` block.

    In a pipe or a log it prints the 1st, 2nd, 4th, 8th text and so on.
    """
    if console.is_interactive:
        with console.status(task, spinner="line", refresh_per_second=2) as status:
            yield status.update
    else:
        yield _Rarer().show


class _Rarer:
    def __init__(self) -> None:
        self.count = 0

    def show(self, text: str) -> None:
        self.count += 1
        if self.count & (self.count - 1) == 0:
            console.print(text, highlight=False, soft_wrap=True)
