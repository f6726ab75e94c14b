"""Fit methods: the program finds every optimum, in about the time of lmfit."""

from __future__ import annotations

import pytest

from acquisition.benchmark.studies.fit_methods import fit_studies, lmfit_fit, program_fit
from acquisition.benchmark.studies.fit_truth import (
    SCENES,
    Scene,
    noisy_scan,
    optimum,
    random_starts,
)
from tests.support.benchmark import FEW, trial_of
from tests.support.timing.cpu_time import cpu_ratio


def test_the_program_finds_every_optimum() -> None:
    near, misses = fit_studies(FEW)
    for study in (near, misses):
        assert study.scenes == near.scenes
    for scene in near.scenes:
        own = trial_of(near, scene, "grid, scales solved")
        assert own.failures == 0
        assert own.error < 1e-3
        assert trial_of(misses, scene, own.label).error == 0
        assert trial_of(near, scene, "lmfit").peer


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.model)
def test_a_fit_takes_about_the_time_of_lmfit(scene: Scene) -> None:
    """With its search for a start, which lmfit is given. Measured: 0.8 to 1.5 times."""
    problem = noisy_scan(scene, 5)
    start = random_starts(problem, 1)[0]
    assert optimum(problem).distance_u(program_fit(problem, start)) < 1e-3
    ours_over_theirs = cpu_ratio(
        lambda: program_fit(problem, start), lambda: lmfit_fit(problem, start), 6
    )
    assert ours_over_theirs < 5
