"""Relative runs on one level: what remains to be compared is their shape.

A run without a white tile has a level of its own at each setting of its lamp, in a unit of its own.
Its values are multiplied so that they agree with the others as well as they can; the test of the
shape then leaves these levels free, and counts them in its degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from analysis.comparison.agreement import Values, agreement, level_points
from analysis.data.covariance import Covariance
from instrument.geometry import FloatArray

_ROUNDS = 3  # of levels; the first brings them within some per cent, as far as models hold


def on_one_level(
    runs: Sequence[Values], levels: Collection[str], reference: int | None
) -> list[Values]:
    """Return the K runs with all levels brought to that of the run `reference`.

    Without one, the values of the first run have the mean 1.
    levels: beginnings of the names of shared errors that change nothing but a level; they are left
    out. Raises `ValueError` for a run without light in sum, which has no level.
    """
    found = [_without(run, levels) for run in runs]
    for n, run in enumerate(runs):
        if not float(np.sum(run.brdf)) > 0:
            raise ValueError(f"run {n + 1}: sum of its values = {np.sum(run.brdf):g}: no light")
    kept = 0 if reference is None else reference
    target = float(runs[0].brdf.size if reference is None else np.sum(runs[kept].brdf))
    found = [_times(run, np.full_like(run.brdf, target / np.sum(run.brdf))) for run in found]
    for _ in range(_ROUNDS):
        found = _nearer(found)
    back = target / float(np.sum(found[kept].brdf))
    return [_times(run, np.full_like(run.brdf, back)) for run in found]


def _nearer(runs: Sequence[Values]) -> list[Values]:
    """Runs after a division by the levels that they have, by the others' values."""
    excess = iter(agreement(runs).excess.tolist())
    levelled = []
    for k, run in enumerate(runs):
        factor = np.ones(run.brdf.size)
        for points in level_points(run, first=k == 0):
            factor[points] = 1 / max(1 + next(excess), 0.1)
        levelled.append(_times(run, factor))
    return levelled


def _times(run: Values, factor: FloatArray) -> Values:
    """The run times a factor (G,), with its uncertainties."""
    c = run.covariance
    common = c.common_dense * factor[:, np.newaxis]
    covariance = Covariance(c.variance * np.square(factor), common, c.names)
    return replace(run, brdf=run.brdf * factor, covariance=covariance, model=run.model * factor)


def _without(run: Values, levels: Collection[str]) -> Values:
    """The run without the shared errors whose names begin with one of `levels`."""
    c = run.covariance
    kept = [n for n, name in enumerate(c.names) if not any(map(name.startswith, levels))]
    covariance = Covariance(c.variance, c.common_dense[:, kept], tuple(c.names[n] for n in kept))
    return replace(run, covariance=covariance)
