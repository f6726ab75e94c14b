"""Console: durations and progress as the operator reads them."""

from __future__ import annotations

import pytest

from acquisition.plan.plan import make_plan
from acquisition.terminal.console import console, duration_text, progress_bar
from instrument.config.load import Loaded


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (59.6, "1 min 00 s"), (61.0, "1 min 01 s"), (3661.0, "1 h 01 min")],
)
def test_a_duration_has_the_units_that_matter(seconds: float, text: str) -> None:
    assert duration_text(seconds) == text


def test_progress_counts_the_steps_accepted_before_a_resume(demo: Loaded) -> None:
    plan = make_plan(demo)
    with console.capture() as shown, progress_bar(plan, frozenset({0, 1})) as on_step:
        on_step(plan.steps[2])
    assert f"3/{len(plan.steps)}" in shown.get()


@pytest.mark.parametrize("width", range(40, 201, 10))
def test_progress_is_whole_in_a_narrow_terminal(
    width: int, demo: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bar, and the time left, go before any number does."""
    plan = make_plan(demo)
    monkeypatch.setattr(console, "_width", width)
    with console.capture() as shown, progress_bar(plan, frozenset()) as on_step:
        for step in plan.steps[:9]:
            on_step(step)
    last = shown.get().splitlines()[-1]
    assert f"9/{len(plan.steps)}" in last
    assert f"θ_i {plan.steps[8].pose.theta_i:g}° θ_r {plan.steps[8].pose.theta_r:g}°" in last
    assert "…" not in last
