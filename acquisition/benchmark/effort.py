"""Effort of a benchmark: the whole one, or a quick one that answers the same questions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """Sample sizes of the studies.

    truths: geometries with a reference value of the reflectance. batch: geometries in one call.
    repeats: of each timing. frame_views: view angles of the window. starts: of a fit, over
    `data_sets` noisy scans. seeds: simulated scans of each setting, and benches
    on which each correction is tried. draws: of a noisy reading.
    thorough: all settings of the scan, not only the decisive ones.
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


WHOLE = Effort(
    name="whole", truths=40, batch=8192, repeats=9, frame_views=11, starts=1000, data_sets=10,
    seeds=12, draws=200, thorough=True,
)  # fmt: skip
QUICK = Effort(
    name="quick", truths=6, batch=4096, repeats=3, frame_views=5, starts=9, data_sets=3,
    seeds=2, draws=40, thorough=False,
)  # fmt: skip
