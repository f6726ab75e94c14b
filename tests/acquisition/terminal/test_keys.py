"""Keys: heard one by one, left to a prompt while it waits; the terminal is as before in the end."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading

import pytest

from acquisition.terminal.keys import keys_heard
from tests.support.paths import ROOT
from tests.support.terminal.session import TerminalSession
from tests.support.timing.deadline import wait_for

pytestmark = pytest.mark.waits

CHILD = ("-m", "tests.support.terminal.keys_child")


def test_keys_are_heard_at_once_and_not_by_a_prompt_that_waits_for_a_line() -> None:
    with TerminalSession(CHILD) as session:
        session.read_until("keys: True")
        assert not session.is_as_before
        for key in "pxP":
            session.press(key)
            session.read_until(f"<{key}>")
        session.press("a")
        session.read_until("Which?")
        session.press("pae\n")
        session.read_until("line: pae")
        session.press("e")
        session.read_until("ended")
        assert session.wait() == 0
        assert session.is_as_before
        assert "<a>" in session.text
        assert session.text.count("<p>") == session.text.count("<e>") == 1


@pytest.mark.parametrize("sequence", ["\x1bOP", "\x1b[15~", "\x1b[A", "\x1bp"])
def test_keys_that_send_several_characters_are_none_of_them(sequence: str) -> None:
    """F1 sends ESC O P, in which a pause would be read."""
    with TerminalSession(CHILD) as session:
        session.read_until("keys: True")
        session.press(sequence)

        def hears_the_next_key() -> bool:
            session.press("x")  # lost if it comes in one piece with the sequence
            session.look(0.1)
            return "<x>" in session.text

        wait_for(hears_the_next_key, "a key after the sequence")
        session.press("e")
        session.read_until("ended")
    assert "<P>" not in session.text
    assert "<p>" not in session.text


def test_without_a_terminal_there_are_no_keys_and_no_thread() -> None:
    done = subprocess.run(
        [sys.executable, *CHILD], cwd=ROOT, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, timeout=60, check=False, env={"PATH": "", "GONIO": ""},
    )  # fmt: skip
    assert done.stdout.startswith("keys: False")


def test_in_a_notebook_or_a_test_nothing_changes() -> None:
    before = threading.active_count()
    with keys_heard(lambda _: None) as heard:
        assert not heard
        assert threading.active_count() == before
    assert signal.getsignal(signal.SIGINT) is not None
