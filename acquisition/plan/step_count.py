"""Count and planned time of the accepted steps of a scan: how far it is, and the time left."""

from __future__ import annotations

from collections.abc import Container

from acquisition.plan.plan import Plan, Step


class StepCount:
    """Accepted steps of a plan, of those that are known; `done`: indices of those accepted so far.

    A scan that chooses its steps knows more of them as it goes on.
    """

    def __init__(self, plan: Plan, done: Container[int]) -> None:
        before = [step for step in plan.known if step.index in done]
        self._plan, self.accepted = plan, len(before)
        self.accepted_s = sum(step.duration_s for step in before)

    @property
    def total(self) -> int:
        """Number of all steps that are known."""
        return len(self._plan.known)

    @property
    def planned_s(self) -> float:
        """Planned duration of all steps that are known, in seconds."""
        return sum(step.duration_s for step in self._plan.known)

    @property
    def growing(self) -> bool:
        """True if more steps may be chosen."""
        return self._plan.growing

    @property
    def left_s(self) -> float:
        """Planned duration of the steps that are left, in seconds."""
        return max(self.planned_s - self.accepted_s, 0.0)

    @property
    def text(self) -> str:
        """Accepted steps of all that are known."""
        return f"{self.accepted}/{self.total}{'+' * self.growing}"

    def add(self, step: Step) -> None:
        """Count an accepted step."""
        self.accepted += 1
        self.accepted_s += step.duration_s
