"""Operator at the terminal: prompts that wait for a person."""

from __future__ import annotations

import sys

from acquisition.terminal.console import ask
from instrument.devices import Request
from instrument.errors import InputError, OperatorStop

_STOP = ("q", "quit", "stop")


class TerminalOperator:
    """Asks on standard error and reads the answer from standard input."""

    def ask(self, request: Request) -> str:
        """Return the answer, "done" for Enter alone; raise `OperatorStop` for `q` or no input."""
        more = "type the angle if it is another, " if request.action == "set axis" else ""
        try:
            answer = ask(f"\n{request.text}. Enter when done; {more}q to stop:")
        except (EOFError, OSError):  # its end, or the terminal is gone
            raise OperatorStop("standard input ended: nobody answers") from None
        if answer.lower() in _STOP:
            raise OperatorStop(f"stopped at the prompt: {request.text}")
        return answer or "done"


def require_yes(question: str, no_terminal: str, declined: str) -> None:
    """Ask for permission to move.

    Raises `InputError` with `no_terminal` if standard input is no terminal, and `OperatorStop` with
    `declined` for any answer but yes.
    """
    if not sys.stdin.isatty():
        raise InputError(no_terminal)
    try:
        answer = ask(f"{question} [y/N]")
    except (EOFError, OSError):
        answer = ""
    if answer.lower() not in ("y", "yes"):
        raise OperatorStop(declined)


def require_terminal(protocol: str) -> None:
    """Raise `InputError`, before anything moves, if no operator can answer prompts."""
    if not sys.stdin.isatty():
        raise InputError(
            f"{protocol}: the rig needs an operator to answer prompts, but standard input is no "
            "terminal: start the scan in one. Nothing has moved."
        )
