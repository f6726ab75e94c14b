"""Runs on one level: shapes of relative runs agree as often as stated, and differ where they do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.comparison.agreement import Values, agreement
from analysis.comparison.levels import on_one_level
from analysis.data.covariance import Covariance

LEVEL = "lamp level"


def drawn(seed: int, relative: tuple[bool, ...], bump: float = 0.0) -> list[Values]:
    """Runs of one sample at three incidences; relative ones have a level of their own at each.

    bump: relative change of the last run at one geometry.
    """
    rng = np.random.default_rng(seed)
    settings = np.repeat([0, 1, 2], rng.integers(3, 9, 3))
    true = rng.uniform(0.05, 0.3, settings.size)
    found = []
    for k, alone in enumerate(relative):
        level = 10 ** rng.uniform(1, 3, 3)[settings] if alone else np.ones(settings.size)
        model = true * level * (1 + 0.01 * rng.normal(size=true.size))
        u = rng.uniform(0.002, 0.01, true.size) * true * level
        dark = 0.005 * true * level
        changed = true * level * (1 + bump * (np.arange(true.size) == 1) * (k == len(relative) - 1))
        common = np.stack([dark, 0.3 * model], axis=-1)
        values = Values(
            brdf=changed + u * rng.normal(size=true.size) + dark * rng.normal(),
            covariance=Covariance(u**2, common, ("dark", f"{LEVEL} 1")),
            model=model,
            settings=rng.permutation(5)[settings] if alone else None,
        )
        found.append(_settled(values, level))
    return found


def _settled(values: Values, level: np.ndarray) -> Values:
    """The run divided by nearly its levels, as by a model near the data."""
    c, near = values.covariance, level * (1 + 0.02 * np.sin(level))
    common = np.asarray(c.common) / near[:, np.newaxis]
    return replace(
        values,
        brdf=values.brdf / near,
        model=values.model / near,
        covariance=Covariance(c.variance / near**2, common, c.names),
    )


CASES = [(False, True), (True, True), (True, False), (False, True, True), (False, False, True)]


def test_shapes_of_one_sample_agree_as_often_as_stated() -> None:
    tests = []
    for seed in range(400):
        runs = drawn(seed, CASES[seed % len(CASES)])
        tests.append(agreement(on_one_level(runs, (LEVEL,), None)).shape)
    chi2, dof = (sum(getattr(test, name) for test in tests) for name in ("chi2", "dof"))
    assert chi2 / dof == pytest.approx(1.0, abs=4 * np.sqrt(2 / dof))
    refused = sum(not test.agrees for test in tests)
    assert refused <= 4 + 4 * np.sqrt(4)  # 1 % of 400, at four standard deviations


@pytest.mark.parametrize("relative", CASES)
def test_a_difference_at_one_geometry_is_found(relative: tuple[bool, ...]) -> None:
    found = [agreement(on_one_level(drawn(s, relative, 0.15), (LEVEL,), 0)) for s in range(20)]
    assert all(not one.shape.agrees for one in found)


@pytest.mark.parametrize("relative", CASES)
def test_every_level_that_is_free_costs_a_degree_of_freedom(relative: tuple[bool, ...]) -> None:
    runs = drawn(5, relative)
    shape = agreement(on_one_level(runs, (LEVEL,), 0)).shape
    whole = (len(runs) - 1) * runs[0].brdf.size
    # Runs with levels of settings have three each, of which one set of three cannot be told where
    # all have them; of absolute runs all but the first have one, or it is among those of the first.
    levels = sum(3 if alone else 1 for alone in relative)
    levels -= 3 if all(relative) else 1
    assert shape.dof == whole - levels


def test_values_keep_the_unit_of_the_reference() -> None:
    runs = drawn(6, (True, False, True))
    found = on_one_level(runs, (LEVEL,), reference=1)
    assert np.sum(found[1].brdf) == pytest.approx(np.sum(runs[1].brdf), rel=1e-12)
    assert np.mean(found[0].brdf / found[1].brdf) == pytest.approx(1.0, abs=0.02)
    assert not any(name.startswith(LEVEL) for run in found for name in run.covariance.names)


def test_without_a_reference_the_first_has_the_mean_1() -> None:
    found = on_one_level(drawn(8, (True, True)), (LEVEL,), None)
    assert np.mean(found[0].brdf) == pytest.approx(1.0, rel=1e-12)
    assert np.mean(found[1].brdf) == pytest.approx(1.0, abs=0.02)


def test_a_run_without_light_has_no_level() -> None:
    runs = drawn(7, (False, True))
    dark = [runs[0], replace(runs[1], brdf=-runs[1].brdf)]
    with pytest.raises(ValueError, match="run 2: sum of its values"):
        on_one_level(dark, (LEVEL,), 0)
