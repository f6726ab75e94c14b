"""State of a scan as its page says it: from its channel while it answers, else from its record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from instrument.processes import locking
from instrument.record.event_kinds import FAULT, FINISHED, RESUMED, STOPPED

_ACTIONS = {
    "measuring": ("pause", "abort"),
    "pausing": ("resume", "abort"),
    "paused": ("resume", "abort"),
    "operator": ("abort",),
}
_ENDS = {FINISHED: "finished", STOPPED: "stopped", FAULT: "failed"}
_KILLED = "The scan ended without a word: its program was killed, or the computer was switched off"
_DAMAGED = "The scan was finished, and readings were damaged on the disk since"
_SILENT = "The scan does not answer: its program hangs, or was halted"
_REMOVED = "The run's folder was removed: shown is what had been measured until then"


class Scan(Protocol):
    """Scan as `ScanWatch` sees it."""

    @property
    def state(self) -> Mapping[str, Any] | None:
        """State that it published last, None if it does not answer."""

    @property
    def answers(self) -> bool:
        """True if it is there."""

    @property
    def silent(self) -> bool:
        """True if it has left its channel and does not answer: it hangs, or was killed."""


class ScanState(NamedTuple):
    """State in one word, in words, and the actions that it allows."""

    state: str
    text: str
    actions: tuple[str, ...] = ()


def scan_state(
    scan: Scan,
    events: Iterable[tuple[str, str, str]],
    folder: Path | None,
    *,
    complete: bool,
    over: bool = False,
) -> ScanState:
    """Return the state of a scan.

    folder: of the run, None if it was removed. complete: all steps are measured. over: the program
    that scans has said that it is ending; it may hold the run for a while yet.
    """
    kind, text = _last_state(events)
    if kind == FINISHED and complete:
        return ScanState("finished", "All steps are measured")
    if scan.state is not None:
        phase = scan.state["phase"]
        shown = phase if phase != "ending" else "measuring"
        return ScanState(shown, scan.state["text"], _ACTIONS.get(phase, ()))
    if folder is None:
        return ScanState("lost", _REMOVED)
    if not over and (scan.answers or any(locking(folder))):
        return ScanState("lost", _SILENT) if scan.silent else ScanState("measuring", "")
    why = _DAMAGED if kind == FINISHED else text or _KILLED
    return ScanState(_ENDS.get(kind, "lost"), f"{why}. Go on with: gonio resume {folder}")


def _last_state(events: Iterable[tuple[str, str, str]]) -> tuple[str, str]:
    """Return kind and text of the last event that says how the scan stands."""
    found = [(kind, text) for _, kind, text in events if kind in (*_ENDS, RESUMED)]
    kind, text = found[-1] if found else ("", "")
    return (kind, "") if kind == RESUMED else (kind, text.rstrip("."))
