"""Operator at the terminal: answers, and stops at a prompt."""

from __future__ import annotations

import io
import sys

import pytest

from acquisition.terminal.operator import TerminalOperator
from instrument.devices import Request
from instrument.errors import OperatorStop


@pytest.mark.parametrize(
    ("typed", "answer"), [("\n", "done"), ("30.2\n", "30.2"), ("  29,9 \n", "29,9")]
)
def test_the_operator_answers_at_the_terminal(
    monkeypatch: pytest.MonkeyPatch, typed: str, answer: str
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    request = Request("set axis", "Set the lamp to 30 degrees", axis="theta_i", angle_deg=30.0)
    assert TerminalOperator().ask(request) == answer


@pytest.mark.parametrize(("typed", "says"), [("q\n", "stopped at the prompt: Put foam"),
                                             ("", "nobody answers")])  # fmt: skip
def test_the_operator_may_stop_or_be_gone(
    monkeypatch: pytest.MonkeyPatch, typed: str, says: str
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    with pytest.raises(OperatorStop, match=says):
        TerminalOperator().ask(Request("place", "Put foam on the sample table"))
