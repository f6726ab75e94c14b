"""The command `gonio` on a pseudo-terminal, with an operator who does what its prompts ask for."""

from __future__ import annotations

import codecs
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from tests.support.paths import ROOT

_PROMPT = re.compile(r"([^\n]*?)\. Enter when done; [^\n]*q to stop:")
_QUESTION = "[y/N]"
DEADLINE_S = 400.0


def gonio_at_terminal(
    *arguments: str | Path, doing: Mapping[str, Callable[[], None]]
) -> tuple[int, str]:
    """Run the command until its end; return its exit code and all that it has shown.

    `doing`: what the operator does at a prompt that begins with these words.
    """
    ours, theirs = os.openpty()
    command = [sys.executable, "-m", "acquisition", *map(str, arguments)]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
    ) as running:
        os.close(theirs)
        try:
            shown = _serve(ours, doing)
        except BaseException:
            running.send_signal(signal.SIGTERM)
            raise
        finally:
            os.close(ours)
        return running.wait(60), shown


def _serve(terminal: int, doing: Mapping[str, Callable[[], None]]) -> str:
    """Answer prompts until the command has closed its terminal; return all that was shown."""
    shown, answered, decoder = "", 0, codecs.getincrementaldecoder("utf-8")()
    until_s = time.monotonic() + DEADLINE_S
    while time.monotonic() < until_s:
        try:
            data = os.read(terminal, 4096)
        except OSError:  # EIO: the other side is closed
            return shown
        shown += decoder.decode(data)
        prompt = _PROMPT.search(shown, answered)
        if prompt:
            answered = prompt.end()
            next(act for words, act in doing.items() if words in prompt[1])()
            os.write(terminal, b"\n")
        elif _QUESTION in shown[answered:]:
            answered = len(shown)
            os.write(terminal, b"y\n")
    raise TimeoutError(f"the command has not ended within {DEADLINE_S:g} s")
