"""Key of the terminal that pauses a scan."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from acquisition.engine.pause import PauseSwitch
from acquisition.terminal.console import console
from acquisition.terminal.keys import keys_heard

KEY = "p"


@contextmanager
def pause_key(switch: PauseSwitch) -> Iterator[None]:
    """Let the operator turn the switch by a key within a `with` block, if there is a terminal."""

    def on_key(key: str) -> None:
        if key.lower() == KEY:
            switch.turn(on=not switch.is_on, by="at the terminal")
            if switch.is_on:
                switch.say(f"pauses after this geometry; {KEY} lets it go on")

    with keys_heard(on_key) as heard:
        if heard:
            console.print(f"{KEY} pauses the scan and lets it go on; Ctrl-C stops it")
        yield
