"""Command `gonio plan` of a protocol with a goal: the first batch, and what all candidates give."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.candidate_list import candidate_list
from acquisition.adaptive.chooser import Chooser
from acquisition.adaptive.course import chooser_of
from acquisition.design.assumed_sample import AssumedSample, assumed_sample
from acquisition.design.forecast import forecast
from acquisition.plan.plan import Step, make_plan
from acquisition.terminal.console import duration_text, print_lines, print_notes, print_text
from instrument.config.load import Loaded


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptivePlan:
    """Beginning of an adaptive scan, before anything is known of the sample.

    first: steps of its first batch. sample: simulated one of the protocol, None without one; floor:
    u of the parameters asked for, in their units, by all candidates together for that sample.
    """

    chooser: Chooser
    first: tuple[Step, ...]
    sample: AssumedSample | None
    floor: Mapping[str, float]

    @classmethod
    def of(cls, loaded: Loaded) -> AdaptivePlan:
        """Plan the scan of a protocol with a goal; raise `InputError` where `gonio run` does."""
        Aims.of(loaded)
        listed = candidate_list(loaded)
        chooser = chooser_of(listed, make_plan(listed))
        points = [step for step, _ in chooser.propose((), (), ()).points]
        sample, floor = None, dict[str, float]()
        if loaded.protocol.simulated_sample is not None:
            sample = assumed_sample(None, listed)
            u = forecast(listed, chooser.layout.plan, sample).u()
            floor = {name: u[name] for name in chooser.aims.u if name in u}
        first = tuple(chooser.layout.batch(points, ()))
        return cls(chooser=chooser, first=first, sample=sample, floor=floor)

    def as_json(self) -> dict[str, Any]:
        """Return the plan as plain values; times in seconds, angles in degrees."""
        aims = self.chooser.aims
        return {
            "until": dict(aims.u),
            "budget_s": aims.budget_s,
            "candidates": len(self.chooser.points),
            "first_batch": [step.pose._asdict() for step in self.first if step.kind == "point"],
            "first_batch_s": self.chooser.layout.seconds(self.first),
            "u_of_all_candidates": dict(self.floor) or None,
        }

    def show(self) -> None:
        """Print the goal, the first batch, and what all candidates together would give."""
        aims, seconds = self.chooser.aims, self.chooser.layout.seconds(self.first)
        limit = "" if aims.budget_s is None else f", at most {duration_text(aims.budget_s)}"
        print_lines([""])
        print_text(
            f"The scan chooses its geometries until {aims.text}{limit}, among "
            f"{len(self.chooser.points)} candidates: those of the sweeps and between their views."
        )
        poses = (step.pose for step in self.first if step.kind == "point")
        views = "; ".join(f"{p.theta_i:g}, {p.dphi:g}, {p.theta_r:g}" for p in poses)
        print_notes(
            [
                f"first batch, with references {duration_text(seconds)}: (theta_i, dphi, theta_r) "
                f"= {views}",
                self._floor_text(),
            ]
        )

    def _floor_text(self) -> str:
        if self.sample is None:
            return ""
        u = ", ".join(f"u({name}) {value:.2g}" for name, value in self.floor.items())
        return f"all candidates, once each: {u or 'not known'}, for {self.sample.text}"
