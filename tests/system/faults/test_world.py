"""Faults of the world, which no device reports, in whole scans: no wrong point without a flag.

Each point that is off by more than 3 u from the sound scan with the same noise is flagged, or the
scan stops with an exit code that is not 0; and it is not among the points once the scan has been
resumed in a sound world. The other way round, sound scans raise no interlock and no new flag.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.whole_scans.random_scans import RIGS, random_scan, warming_lamp
from tests.support.whole_scans.world_attacks import reduced_scan, scanned

OLD_FLAGS = {"window leaves frame", "too few pixels", "saturated", "hot pixels"}
WARM_UP = 0.01  # of the lamp's output, within a third of a scan


def _false_alarms(rig: str, seed: int, folder: Path, shrink: int) -> list[str]:
    """Errors and flags of a sound scan; every fifth has a lamp that warms up."""
    loaded = random_scan(rig, seed, shrink=shrink)
    faults = warming_lamp(WARM_UP, 300) if seed % 5 == 0 else None
    result = scanned(loaded, folder, faults)
    if result.error is not None:
        return [f"{rig} {seed}: {result.error}"]
    flags = {f for flags in reduced_scan(loaded, folder).flags for f in flags.split("; ") if f}
    return [f"{rig} {seed}: {flag}" for flag in sorted(flags - OLD_FLAGS)]


@pytest.mark.slow
def test_sound_scans_raise_no_interlock(slow: bool, tmp_path: Path) -> None:
    """201 scans of full size with --slow, else 6 small ones."""
    found = []
    for seed in range(67 if slow else 2):
        for rig in RIGS:
            found += _false_alarms(rig, seed, tmp_path / f"{rig} {seed}", 1 if slow else 4)
    assert found == []
