"""Errors of the lamp's level that drift checks leave: their noise, and changes between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.measure.drift import Drift
from analysis.data.measurements import SharedError
from instrument.geometry import FloatArray
from instrument.record.reading import Reading

DRIFT, WANDER = "lamp drift", "lamp wander"


def drift_noise(points: Sequence[Reading], drifts: Mapping[int, Drift]) -> tuple[SharedError, ...]:
    """Return the noise of the drift checks as shared errors: each affects the points next to it.

    The level at a point is interpolated between the check before it and the one after. One of the
    two has an even number and the other an odd one, so two errors hold all of them. A third is the
    block's first check, relative to which all levels of the block are given, with opposite sign.
    """
    if not any(drift.level.size for drift in drifts.values()):
        return ()
    u_relative = np.zeros((3, len(points)))
    check = np.zeros((3, len(points)), dtype=np.int64)
    block, time_s = (np.array([getattr(p, n) for p in points]) for n in ("block", "time_s"))
    passed = 0
    for number, drift in drifts.items():
        own = np.flatnonzero(block == number)
        if drift.level.size and own.size:
            u, (before, share) = drift.u_relative, drift.interpolation(time_s[own])
            after = np.minimum(before + 1, u.size - 1)
            u_relative[0, own], check[0, own] = u[0], passed
            for made, part in ((before, 1.0 - share), (after, share)):
                row = np.where(made == 0, 0, 1 + made % 2)
                u_relative[row, own] -= part * u[made]
                check[row, own] = passed + made
        passed += drift.level.size
    return tuple(SharedError(DRIFT, u, group) for u, group in zip(u_relative, check, strict=True))


def drift_between(
    points: Sequence[Reading], drifts: Mapping[int, Drift]
) -> tuple[SharedError, ...]:
    """Return the error of a level that may have changed at any moment between two checks."""
    block, time_s = (np.array([getattr(p, n) for p in points]) for n in ("block", "time_s"))
    u, group = np.zeros(len(points)), np.zeros(len(points), dtype=np.int64)
    for number, drift in drifts.items():
        own = np.flatnonzero(block == number)
        if drift.level.size and own.size:
            u[own] = drift.u_between(time_s[own])
            group[own] = drift.interpolation(time_s[own])[0] + 1 + group.max()
    return (SharedError(DRIFT, u, group),) if u.any() else ()


def wander(points: Sequence[Reading], drifts: Mapping[int, Drift]) -> dict[str, FloatArray]:
    """Return the relative u (N,) of changes that the checks show at random; none if steady."""
    u = np.array([drifts[p.block].u_wander(p.time_s) for p in points])
    return {WANDER: u} if u.any() else {}
