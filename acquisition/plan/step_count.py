"""Count and planned time of the accepted steps of a scan: how far it is, and the time left."""

from __future__ import annotations

from collections.abc import Container

from acquisition.plan.plan import Plan, Step


class StepCount:
    """Accepted steps of a plan; `done`: indices of those accepted so far."""

    def __init__(self, plan: Plan, done: Container[int]) -> None:
        before = [step for step in plan.steps if step.index in done]
        self.total, self.accepted = len(plan.steps), len(before)
        self.planned_s = sum(step.duration_s for step in plan.steps)
        self.accepted_s = sum(step.duration_s for step in before)

    @property
    def left_s(self) -> float:
        """Planned duration of the steps that are left, in seconds."""
        return max(self.planned_s - self.accepted_s, 0.0)

    @property
    def text(self) -> str:
        """Accepted steps of all."""
        return f"{self.accepted}/{self.total}"

    def add(self, step: Step) -> None:
        """Count an accepted step."""
        self.accepted += 1
        self.accepted_s += step.duration_s
