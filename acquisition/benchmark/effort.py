"""How much is measured: the whole of it, or a quick form that asks the same questions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effort:
    """Counts of each study.

    truths: geometries of which the true reflectance is worked out. batch: geometries at once.
    repeats: of what is timed. frame_views: view angles of the window. starts: of a fit, over
    `data_sets` noisy scans. seeds: simulated scans of each setting. draws: of a noisy reading.
    thorough: all settings of the scan, or the decisive ones.
    """

    name: str
    truths: int
    batch: int
    repeats: int
    frame_views: int
    starts: int
    data_sets: int
    seeds: int
    draws: int
    thorough: bool


WHOLE = Effort("whole", 40, 8192, 9, 11, 1000, 10, 12, 200, True)
QUICK = Effort("quick", 6, 4096, 3, 5, 9, 3, 2, 40, False)
