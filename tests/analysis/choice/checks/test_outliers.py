"""Outliers: found where a model explains all but a few points, and not where a model is missing.

False alarms: none in 200 sound scans of random models, half without u (slow form; normally 1).
Found: at least 90 % of tables with 3 to 10 % of outliers.
"""

from __future__ import annotations

import numpy as np
import pytest

from analysis.choice.checks.outliers import Outliers, outliers
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFits
from analysis.fit.fit import refine
from analysis.models import MODELS
from tests.support.analysis.table_faults import (
    bench_errors,
    lamp_swapped,
    matt_table,
    sound_table,
    with_outliers,
)

DARK = 1e-15  # mean value in 1/sr: no light


def found(m: Measurements, *names: str) -> Outliers | None:
    fits = FirstFits(m)
    first = [fits.of(MODELS[name]) for name in names]
    usual = refine(first[-1], m, None, u="none")
    return outliers(first, m, None, usual)


@pytest.mark.slow
def test_sound_scans_of_random_models_give_no_alarm(slow: bool) -> None:
    told = []
    for seed in range(200 if slow else 1):
        sound = sound_table(seed)
        if not np.mean(sound.measurements.brdf) > DARK:
            continue  # refused by the choice of a model
        told += [seed] if found(sound.measurements, "minnaert", sound.model.name) else []
    assert not told


@pytest.mark.slow
def test_systematic_errors_of_a_bench_are_no_outliers(slow: bool) -> None:
    """Rarely, as an error that grows may look like one: in 1 % of the scans at most."""
    seeds, told = range(3000, 3300 if slow else 3001), []
    for seed in seeds:
        sound = sound_table(seed)
        if np.mean(sound.measurements.brdf) > DARK:
            m = bench_errors(sound.measurements, seed)
            told += [seed] if found(m, "minnaert", sound.model.name) else []
    assert len(told) <= 0.01 * len(seeds), told


@pytest.mark.slow
def test_outliers_are_found(slow: bool) -> None:
    seeds = range(60 if slow else 5)
    missed, wrong = [], 0
    for seed in seeds:
        sound = matt_table(seed, stated=bool(seed % 3))
        m, points = with_outliers(sound.measurements, (0.03, 0.06, 0.1)[seed % 3], seed)
        told = found(m, "lambert", "oren_nayar", "oren_nayar+torrance_sparrow_lobe")
        if told is None:
            missed.append(seed)
        else:
            wrong += np.setdiff1d(told.points, points).size
            assert told.worst in points
            assert "--robust" in told.text(m)
    assert len(missed) <= 0.1 * len(seeds), missed
    assert wrong <= 0.1 * len(seeds)


def test_a_wrong_model_has_no_outliers() -> None:
    """A swapped lamp, and a lobe that the models lack: many points are off, in stretches."""
    matt, glossy = matt_table(2).measurements, matt_table(3).measurements
    assert found(lamp_swapped(matt), "lambert", "oren_nayar") is None
    assert found(glossy, "lambert", "oren_nayar") is None


def test_a_model_with_many_parameters_for_the_points_proves_nothing() -> None:
    """16 points and seven parameters: two points far off the fit to the others are no evidence."""
    m = sound_table(111).measurements
    assert m.size == 16
    assert found(m, "minnaert", "unified") is None


def test_a_bright_point_in_the_mirror_direction_is_a_lobe() -> None:
    m, _ = with_outliers(matt_table(2, incidences=1).measurements, 0.0, 1)
    y = matt_table(2, incidences=1).measurements.brdf.copy()
    y[np.argmin(np.abs(m.theta_r_deg + m.theta_i_deg))] *= 1.5
    spike = Measurements.bare(m.theta_i_deg, m.theta_r_deg, 0.0, y, m.u_random)
    assert found(spike, "lambert", "oren_nayar") is None
