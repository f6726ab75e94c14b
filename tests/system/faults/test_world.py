"""Faults of the world, which no device reports, in whole scans: no wrong point without a flag.

Each point that is off by more than 3 u from the sound scan with the same noise is flagged, or the
scan stops with an exit code that is not 0; and it is not among the points once the scan has been
resumed in a sound world. The other way round, sound scans raise no interlock and no new flag.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from instrument.config.load import Loaded
from tests.support.whole_scans.random_scans import RIGS, random_scan, warming_lamp
from tests.support.whole_scans.world_attacks import (
    Attack,
    Outcome,
    always,
    attacked,
    reduced_scan,
    scanned,
    sound_scan,
)
from tests.support.whole_scans.world_faults import ATTACKS, LIGHT, OUTLINE, UNSEEN, may_be_silent

OLD_FLAGS = {"window leaves frame", "too few pixels", "saturated", "hot pixels"}
SHARE = (  # of the attacks, in the normal run, each on one of the rigs
    "lamp dies in mid-scan", "darks leak", "one frame partly black", "gain changed",
    "the same picture for ever", "lamp flickers always",
)  # fmt: skip
AT_RESUME = (
    Attack("lamp dead at the resume", "lamp", ("0", "0.5"), always, LIGHT),
    Attack(
        "tile on the table at the resume", "mounted", ("white tile", "nothing"), always, OUTLINE
    ),
)
SHRINK = 4  # of the pictures' sides in the normal run
WARM_UP = 0.01  # of the lamp's output


def _false_alarms(rig: str, seed: int, folder: Path, shrink: int) -> list[str]:
    """Errors and flags of a sound scan; every fifth has a lamp that warms up."""
    loaded = random_scan(rig, seed, shrink=shrink)
    faults = warming_lamp(WARM_UP, loaded) if seed % 5 == 0 else None
    result = scanned(loaded, folder, faults)
    if result.error is not None:
        return [f"{rig} {seed}: {result.error}"]
    flags = {f for flags in reduced_scan(loaded, folder).flags for f in flags.split("; ") if f}
    return [f"{rig} {seed}: {flag}" for flag in sorted(flags - OLD_FLAGS)]


@pytest.mark.slow
def test_sound_scans_raise_no_interlock(slow: bool, tmp_path: Path) -> None:
    """201 scans of full size with --slow, else 3 small ones."""
    found = []
    scans = [(seed, rig) for seed in range(67) for rig in RIGS] if slow else enumerate(RIGS)
    for seed, rig in scans:
        found += _false_alarms(rig, seed, tmp_path / f"{rig} {seed}", 1 if slow else SHRINK)
    assert found == []


def _outcomes(
    loaded: Loaded, seed: int, attacks: list[Attack], folder: Path, slow: bool
) -> dict[tuple[str, str], Outcome]:
    """What became of attacks at both sizes, or only the larger one, by name and size."""
    sound, found = sound_scan(loaded, folder / "sound"), dict[tuple[str, str], Outcome]()
    for attack in attacks:
        for number, size in enumerate(attack.sizes if slow else attack.sizes[:1]):
            random = np.random.default_rng([seed, *attack.name.encode(), number])
            changes = attack.course(attack, size, sound, random)
            stop = int(random.choice(sound.proven())) if attack in AT_RESUME else 0
            run = folder / f"{attack.name} {size}"
            found[attack.name, size] = attacked(loaded, run, sound, changes, stop)
    return found


@pytest.mark.slow
def test_no_point_is_wrong_without_a_flag(
    slow: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """All attacks on each rig with --slow, else a few; `--junitxml` shows each outcome.

    Those in `UNSEEN` may be silent, at the sizes and in the scans that it names, and no others.
    """
    silent = []
    for number, rig in enumerate(RIGS):
        share = [a for a in ATTACKS if a.name in SHARE[number::3]] + list(AT_RESUME[number:1])
        attacks = [*ATTACKS, *AT_RESUME] if slow else share
        for seed in range(3) if slow else (7,):
            folder = tmp_path / f"{rig} {seed}"
            loaded = random_scan(rig, seed, shrink=1 if slow else SHRINK, least_frames=3)
            for (name, size), outcome in _outcomes(loaded, seed, attacks, folder, slow).items():
                record_property(f"{rig} {seed}: {name} {size}", outcome.word)
                if outcome.silent and not may_be_silent(name, size, loaded):
                    silent.append((rig, seed, name, size, outcome.word))
    assert silent == []


def test_the_unseen_attacks_are_among_all() -> None:
    sizes = {attack.name: attack.sizes for attack in (*ATTACKS, *AT_RESUME)}
    assert all(set(unseen.sizes) <= set(sizes[name]) for name, unseen in UNSEEN.items())
