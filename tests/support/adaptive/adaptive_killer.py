"""Adaptive scans that are killed with SIGKILL: `FOLDER KILLS SEED`; it prints the outcome as JSON.

A process that can fork, as `tests.support.storage.scan_killer` is. The next batch is chosen in a
thread while a batch is measured, so that kills meet both.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from acquisition.adaptive.course import chooser_of, chosen_while_measured
from acquisition.plan.plan import make_plan
from instrument.record.reading import Batch, batches_of
from instrument.record.record import Record
from tests.support.adaptive.short_list import short_list
from tests.support.storage.scan_killer import Killer, at_random, opened, scan_claimed


class AdaptiveKiller(Killer):
    """Scans that choose their steps, in forked processes that are killed."""

    def __init__(self, folder: Path) -> None:
        loaded = short_list()
        self._chooser = chooser_of(loaded, make_plan(loaded))
        super().__init__(folder, loaded)
        with Record.open(folder / "whole") as record:
            self._choices = choices(record)

    def scan(self, run: Path, told: Callable[[int], None] = lambda _: None) -> None:
        """Start or resume the scan in a folder; `told` is called with each accepted step."""
        with opened(run) as record, record.claimed():
            scan_claimed(record, self._loaded, chosen_while_measured(self._chooser, record), told)

    def look(self, run: Path, accepted: set[int]) -> None:
        """Count what a killed scan has lost, duplicated or changed, its choices included."""
        super().look(run, accepted)
        with opened(run) as record:
            found = choices(record)
        self.outcome.choices_unequal += found != self._choices[: len(found)]

    def _compare_whole(self, record: Record) -> None:
        self.outcome.choices_unequal += choices(record) != self._choices


def choices(record: Record) -> list[Batch]:
    """Choices of an adaptive scan, but for the expected time, which resumes change."""
    return [replace(batch, seconds=0.0) for batch in batches_of(record.events())]


def main() -> None:
    folder, kills, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    killer = AdaptiveKiller(folder)
    at_random(killer, folder, kills, seed)
    sys.stdout.write(json.dumps(asdict(killer.outcome)))


if __name__ == "__main__":
    main()
