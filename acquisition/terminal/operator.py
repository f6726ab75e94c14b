"""The operator at the terminal: prompts that wait for a person."""

from __future__ import annotations

import sys

from acquisition.terminal.console import ask
from instrument.devices import Request
from instrument.errors import InputError, OperatorStop

_STOP = ("q", "quit", "stop")


class TerminalOperator:
    """Asks on standard error and reads the answer from standard input."""

    def ask(self, request: Request) -> str:
        """What the operator answers; Enter alone says that it is done. `q` stops the scan."""
        more = "type the angle if it is another, " if request.action == "set axis" else ""
        try:
            answer = ask(f"\n{request.text}. Enter when done; {more}q to stop:")
        except EOFError:
            raise OperatorStop("standard input ended: nobody answers") from None
        if answer.lower() in _STOP:
            raise OperatorStop(f"stopped at the prompt: {request.text}")
        return answer or "done"


def require_yes(question: str, nobody: str, otherwise: str) -> None:
    """Nothing moves before somebody has said so.

    Raises `InputError` with `nobody` where none can be asked, `OperatorStop` with `otherwise` on
    any answer but yes.
    """
    if not sys.stdin.isatty():
        raise InputError(nobody)
    try:
        answer = ask(f"{question} [y/N]")
    except EOFError:
        answer = ""
    if answer.lower() not in ("y", "yes"):
        raise OperatorStop(otherwise)


def require_terminal(what: str) -> None:
    """Raise `InputError` where nobody can answer a prompt, before anything moves."""
    if not sys.stdin.isatty():
        raise InputError(
            f"{what}: the operator has to serve the rig, but standard input is no terminal: start "
            "it in one. Nothing has moved."
        )
