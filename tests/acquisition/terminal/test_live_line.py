"""Line that changes: rarer lines in a log, one line in a terminal."""

from __future__ import annotations

from io import StringIO

import pytest

from acquisition.terminal import live_line as module
from acquisition.terminal.console import EscapingConsole
from acquisition.terminal.live_line import live_line


def shown(monkeypatch: pytest.MonkeyPatch, terminal: bool) -> str:
    written = StringIO()
    console = EscapingConsole(file=written, force_terminal=terminal, width=80)
    monkeypatch.setattr(module, "console", console)
    with live_line("lamp") as show:
        for number in range(1, 10):
            show(f"text {number}")
    return written.getvalue()


def test_in_a_log_lines_grow_rarer(monkeypatch: pytest.MonkeyPatch) -> None:
    assert shown(monkeypatch, terminal=False).split("\n")[:-1] == [
        f"text {n}" for n in (1, 2, 4, 8)
    ]


def test_in_a_terminal_the_last_text_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert "text 9" in shown(monkeypatch, terminal=True)
