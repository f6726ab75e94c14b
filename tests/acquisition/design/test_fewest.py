"""Fewest geometries for a goal: reached, with one fewer missed; or refused with the sources."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.design.assumed_sample import assumed_sample
from acquisition.design.fewest import fewest
from acquisition.design.goal import Goal
from acquisition.design.optimal_plan import Planner
from instrument.config.load import Loaded
from instrument.config.protocol import FitConfig
from instrument.errors import InputError
from tests.support.scans import changed

LIKE = "minnaert:albedo=0.5,k=0.8"


def _planner(small: Loaded, goal: Goal) -> Planner:
    loaded = changed(small, fit=FitConfig(models=["lambert", "minnaert"]))
    return Planner.of(loaded, assumed_sample(LIKE, loaded), list(goal.u), goal=goal)


@pytest.mark.parametrize("seed", range(4))
def test_the_goal_is_reached_and_missed_with_one_fewer(small: Loaded, seed: int) -> None:
    rng = np.random.default_rng(seed)
    least = _planner(small, Goal({"k": 0.1, "albedo": 0.1})).every.u()
    goal = Goal({name: least[name] * rng.uniform(1.05, 3) for name in ("k", "albedo")})
    planner = _planner(small, goal)
    found = fewest(planner, goal)
    count = len(found.reasons)
    assert goal.missed(found.chosen.u) == []
    assert count == len(planner.every.x) or goal.missed(planner.chosen(count - 1)[1].u)
    for sources in found.sources.values():
        assert sum(sources.values()) == pytest.approx(1)
        assert list(sources.values()) == sorted(sources.values(), reverse=True)


def test_a_goal_that_no_choice_reaches_is_refused_with_the_sources_of_error(small: Loaded) -> None:
    goal = Goal({"k": 1e-6, "albedo": 0.1})
    with pytest.raises(
        InputError, match=r"--until k=1e-06: all .* give a u of .* % noise"
    ) as error:
        fewest(_planner(small, goal), goal)
    assert "albedo" not in str(error.value)
