"""Plan of a few geometries that determine the parameters asked for best, beside the sweeps.

Candidates are the geometries of the protocol and those halfway between its views. Choosing is
`analysis.design`; here are the plans of what is chosen, their duration and the u that they give.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.design.assumed_sample import AssumedSample
from acquisition.design.bench_time import bench_time
from acquisition.design.forecast import Forecast, forecast
from acquisition.design.geometries import (
    candidate_plan,
    grouped,
    quicker,
    settings_of,
    uniform,
)
from acquisition.design.goal import Goal
from acquisition.plan.plan import Plan, make_plan
from acquisition.plan.pose import Pose
from analysis.choice.ladder import CANDIDATES, with_method
from analysis.design.bound import best_weights
from analysis.design.optimal import Candidates, Pick, choose
from analysis.design.rivals import Rival, leading
from instrument.config.load import Loaded
from instrument.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """A plan with its forecast; u: of each parameter, in its unit, that it will give."""

    loaded: Loaded
    plan: Plan
    forecast: Forecast
    u: dict[str, float]

    @property
    def minutes(self) -> float:
        """Time on the bench in minutes."""
        return self.plan.duration_s / 60


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimalPlan:
    """Chosen plan, with what each geometry is for, beside uniform sweeps.

    reasons: of each point of the plan, in its order. sweeps: the protocol's own. same_time: uniform
    sweeps that take about the time of the chosen plan; None where the fewest views take more, or
    a zone bars them.
    efficiency: least root of the summed variances that any choice of as many points, repetitions
    included, can have, over that of the chosen ones: at most 1. rivals: models that the plan tells
    apart, with the chi2 by which the best fit of each will miss the values. between: candidates
    between the protocol's own geometries, of all `candidates`. sources: parts of the variance of
    each parameter asked for by the source of error, of a sum of 1, largest first. goal: wanted u,
    None where a number of geometries was asked for.
    """

    sample: AssumedSample
    asked: tuple[str, ...]
    chosen: Planned
    reasons: tuple[str, ...]
    sweeps: Planned
    same_time: Planned | None
    efficiency: float
    rivals: dict[str, float]
    candidates: int
    between: int
    sources: dict[str, dict[str, float]]
    goal: Goal | None


@dataclass(frozen=True, slots=True)
class Planner:
    """Candidates of a protocol for a sample, from which plans of any size are chosen.

    points: poses of the candidates that can be used, in the order of `listed`. goal: u wanted of
    the parameters asked for, which else count alike.
    """

    loaded: Loaded
    sample: AssumedSample
    asked: tuple[str, ...]
    own: Plan
    points: tuple[Pose, ...]
    every: Forecast
    listed: Candidates
    rivals: tuple[Rival, ...]
    goal: Goal | None = None

    @classmethod
    def of(
        cls,
        loaded: Loaded,
        sample: AssumedSample,
        asked: Sequence[str],
        count: int | None = None,
        goal: Goal | None = None,
    ) -> Planner:
        """Forecast all candidates, and fit the models that could pass for the sample.

        Raises `InputError` if `count` of them, or as many as parameters, cannot be chosen.
        """
        own = make_plan(loaded)
        finer, plan = candidate_plan(loaded, own)
        every = forecast(finer, plan, sample)
        kept = zip(plan.points, every.used, strict=True)
        points = tuple(step.pose for step, used in kept if used)
        _require(len(every.x) if count is None else count, len(every.x), len(points))
        listed = Candidates(
            geometry=every.measurements.geometry,
            information=every.information,
            costs=bench_time(finer, plan, every.used),
        )
        names = loaded.protocol.fit.models or with_method(CANDIDATES, "functional")
        rivals = leading(every.problem, every.measurements, names)
        return cls(loaded, sample, tuple(asked), own, points, every, listed, rivals, goal)

    def chosen(self, count: int, seed: int = 0) -> tuple[tuple[Pick, ...], Planned]:
        """Choose `count` candidates and plan them.

        Raises `InputError` where a keep-out zone bars the way from one to the next.
        """
        picks = choose(
            self.listed, self.asked, count, rivals=self.rivals, goal=self._wanted, seed=seed
        )
        poses = [self.points[pick.candidate] for pick in picks]
        order = list(settings_of(self.own))
        groups = grouped(poses)
        ordered = {setting: groups[setting] for setting in order if setting in groups}
        try:
            return picks, self._planned(*quicker(self.loaded, ordered))
        except InputError as error:
            raise InputError(
                f"{count} geometries: {'; '.join(error.problems)}. The chosen geometries leave out "
                "those on the protocol's way around the zone: choose another number, or leave the "
                "views beside the zone out of the protocol"
            ) from None

    def uniform(self, views: int) -> Planned:
        """Plan uniform sweeps of so many views at each setting of the lamp."""
        return self._planned(*self._sweeps_of(views))

    def sweeps(self) -> Planned:
        """Plan the protocol as it is."""
        return self._planned(self.loaded, self.own)

    def uniform_within(self, seconds: float) -> Planned | None:
        """Plan the uniform sweeps with the most views that take so much time; None for none.

        They may take a twentieth more.
        """
        seconds *= 1.05
        low, high = 2, 4
        while high < len(self.own.points) and self._duration_s(high) <= seconds:
            low, high = high, 2 * high
        if self._duration_s(low) > seconds:
            return None
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if self._duration_s(middle) <= seconds else (low, middle)
        return self.uniform(low)

    def _duration_s(self, views: int) -> float:
        """Duration of uniform sweeps; infinite where a keep-out zone bars them."""
        try:
            return self._sweeps_of(views)[1].duration_s
        except InputError:
            return float("inf")

    def _sweeps_of(self, views: int) -> tuple[Loaded, Plan]:
        return quicker(self.loaded, uniform(settings_of(self.own), views))

    def _planned(self, loaded: Loaded, plan: Plan) -> Planned:
        found = forecast(loaded, plan, self.sample)
        return Planned(loaded=loaded, plan=plan, forecast=found, u=found.u())

    def optimal(self, count: int, seed: int = 0) -> OptimalPlan:
        """Choose `count` geometries, and compare them with the sweeps."""
        picks, chosen = self.chosen(count, seed)
        reasons = {self.points[pick.candidate]: pick.reason for pick in picks}
        design = np.zeros(len(self.points), dtype=bool)
        design[[pick.candidate for pick in picks]] = True
        own = settings_of(self.own)
        return OptimalPlan(
            sample=self.sample,
            asked=self.asked,
            chosen=chosen,
            reasons=tuple(reasons[step.pose] for step in chosen.plan.points),
            sweeps=self.sweeps(),
            same_time=self.uniform_within(chosen.plan.duration_s),
            efficiency=self._efficiency(design.astype(np.float64)),
            rivals={rival.name: rival.missed(design) for rival in self.rivals},
            candidates=len(self.points),
            sources=self.sources(chosen),
            goal=self.goal,
            between=sum(pose.theta_r not in own[pose.theta_i, pose.dphi] for pose in self.points),
        )

    def sources(self, planned: Planned) -> dict[str, dict[str, float]]:
        """Parts of the variance of each parameter asked for, by the source of error."""
        return {name: planned.forecast.sources(name) for name in self.asked}

    @property
    def _wanted(self) -> Mapping[str, float] | None:
        return None if self.goal is None else self.goal.u

    def _efficiency(self, counts: np.ndarray) -> float:
        information = self.listed.information
        weights = information.weights(self.asked, self._wanted)
        own = float(weights @ np.diag(information.covariance(counts)))
        bound = best_weights(information, weights, float(counts.sum())).bound
        return float(np.sqrt(bound / own))


def _require(count: int, least: int, most: int) -> None:
    if most < least:
        raise InputError(
            f"the sweeps have {most} geometries that can be used, and {least} parameters are to be "
            "determined; allowed: as many geometries or more: add views to the protocol"
        )
    if not least <= count <= most:
        raise InputError(
            f"--optimal {count}; allowed: {least}, the parameters to determine, to {most}, the "
            "geometries of the sweeps and those between them"
        )
