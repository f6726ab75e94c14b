"""Trials: impossible ones are refused, and the front holds those that nothing beats."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition.benchmark.trial import pareto_front, select
from tests.support.benchmark import study, trial


@given(
    st.lists(
        st.tuples(st.floats(1e-3, 1e3), st.one_of(st.floats(0, 10), st.just(math.inf))), max_size=30
    )
)
def test_the_front_is_what_nothing_beats(points: list[tuple[float, float]]) -> None:
    trials = [trial("s", "x", str(n), *point) for n, point in enumerate(points)]
    front = pareto_front(trials)
    assert [t.cost for t in front] == sorted(t.cost for t in front)
    for t in front:
        assert math.isfinite(t.error)
        assert not any(o.cost <= t.cost and o.error < t.error for o in trials)
    for t in trials:
        beaten_or_on_it = any(f.cost <= t.cost and f.error <= t.error for f in front)
        assert beaten_or_on_it or not math.isfinite(t.error)


def test_a_limit_is_not_on_the_front() -> None:
    labels = [t.label for t in pareto_front(study("s").in_scene("calm"))]
    assert labels == ["cheap", "usual", "flawless"]


def test_trials_are_selected_by_scene_label_and_default() -> None:
    trials = study("s").trials
    assert select(trials) == list(trials)
    assert [t.scene for t in select(trials, label="cheap")] == ["calm", "rough <&>"]
    assert [t.label for t in select(trials, scene="calm", default=True)] == ["usual"]
    assert len(select(trials, default=False)) == len(trials) - 2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"cost": 0.0}, r"s, x, a: cost = 0; allowed: finite, more than 0"),
        ({"cost": math.inf}, "cost = inf"),
        ({"error": -1.0}, "error = -1; allowed: 0 or more"),
        ({"error_median": math.nan}, "error_median = nan"),
        ({"failures": 3, "attempts": 2}, "failures = 3; allowed: 0 to 2 attempts"),
    ],
)
def test_an_impossible_trial_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        replace(trial("s", "x", "a", 1.0, 1.0), **change)
