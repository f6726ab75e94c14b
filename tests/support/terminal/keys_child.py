"""Listener for keys that says what it hears: `a` has it ask for a line, `e` ends it."""

from __future__ import annotations

import sys
import threading

from acquisition.terminal.console import ask
from acquisition.terminal.keys import keys_heard


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    pressed, told = list[str](), threading.Event()

    def on_key(key: str) -> None:
        pressed.append(key)
        say(f"<{key}>")
        if key in "ae":
            told.set()

    with keys_heard(on_key) as heard:
        say(f"keys: {heard}")
        while heard and "e" not in pressed and told.wait(60.0):
            told.clear()
            if pressed[-1] == "a":
                say(f"line: {ask('Which?')}")
    say("ended")


if __name__ == "__main__":
    main()
