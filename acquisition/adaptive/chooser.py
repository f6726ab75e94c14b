"""Choice of the next batch of an adaptive scan, from the readings of the batches before the last.

The first two batches are spread over the candidates: nothing is known yet. Each later one follows
from a fit of what was measured up to the last batch but one, so that it can be worked out while the
last one is measured, and no choice depends on how long that takes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from acquisition.adaptive.aims import Aims
from acquisition.adaptive.knowledge import Knowledge, agreeing, closed, corrections, usual_model
from acquisition.adaptive.layout import Layout
from acquisition.adaptive.next_points import Costs, Counts, NextPoints
from acquisition.design.assumed_sample import AssumedSample
from acquisition.design.forecast import Forecaster
from acquisition.plan.plan import Step
from acquisition.plan.recorded_choice import steps_of
from analysis.design.optimal import LACK_OF_FIT, SHARE
from analysis.design.space_filling import farthest_from
from analysis.models import MODELS
from instrument.config.axes import HandAxis
from instrument.errors import InputError
from instrument.geometry import BoolArray, Geometry, IntArray
from instrument.record.reading import Batch, Check, Reading

FIRST, SECOND = 8, 2
"""Points of the first two batches."""

BATCH = 6
"""Points of a later batch; of one that follows two fits which agree, up to as many as before it."""

_LEAST_RATIO = 0.8  # of the u of a fit over that of the forecast for the same points
_ENTRY = 4  # points of the first batch at another setting of the lamp by hand

_AHEAD = 4  # points of the way to the goal, at most, in units of those measured

_PART, _REST = 0.5, 3  # of the way to the goal: part measured next, and points not left for later

Chosen = list[tuple[Step, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """Points to measure next with their reasons, and what is known by then.

    forecast: u of each parameter asked for, in its unit, once the batches before this one are
    measured; floor: once every candidate is; empty where nothing can be told yet. sources: parts of
    the variance that is left then, largest first, by parameter.
    """

    known: Knowledge = field(default_factory=Knowledge)
    points: Chosen
    forecast: Mapping[str, float | None] = field(default_factory=dict)
    floor: Mapping[str, float | None] = field(default_factory=dict)
    sources: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


class Chooser:
    """Choice among the points of a list of candidates; it remembers nothing between two calls."""

    def __init__(self, layout: Layout, aims: Aims) -> None:
        self.layout, self.aims = layout, aims
        self.points = layout.plan.points
        poses = [step.pose for step in self.points]
        self._geometry = Geometry.from_degrees(
            theta_i=np.array([p.theta_i for p in poses]),
            theta_r=np.array([p.theta_r for p in poses]),
            dphi=np.array([p.dphi for p in poses]),
        )
        self._block = np.array([step.block for step in self.points])

    def propose(
        self, batches: Sequence[Batch], readings: Sequence[Reading], checks: Sequence[Check]
    ) -> Proposal:
        """Propose the batch after these; of the readings, those of the last one do not count."""
        known_steps = self.steps(batches)
        done = {step.index for step in known_steps}
        chosen = np.array([step.index in done for step in self.points])
        if len(batches) < 2:
            return Proposal(points=self._opening(known_steps))
        before = self.steps(batches[:-1])
        earlier = {step.index for step in before}
        seen = [reading for reading in readings if reading.step in earlier]
        seen = closed(seen, self.layout, before)
        former = usual_model(batches)
        known = Knowledge.of(seen, checks, self.layout.loaded, self.aims, former)
        measured = np.array([step.index in earlier for step in self.points])
        settled = known.model and not known.contested
        agree = settled and agreeing(batches[-1], known.model, known.verdict)
        counts = Counts(
            batch=max(BATCH, int(chosen.sum())) if agree else BATCH,
            way=max(BATCH, _AHEAD * int(chosen.sum())) if agree else BATCH,
            spread=[why for batch in batches for why in batch.reasons].count(LACK_OF_FIT),
        )
        if known.leading is not None:
            try:
                return self._informed(
                    known,
                    chosen,
                    measured,
                    known_steps,
                    counts,
                    corrections(batches, known.u(self.aims)),
                )
            except (InputError, ValueError):
                pass  # the model found so far foretells no light at all: spread on
        return Proposal(known=known, points=self._spread_on(chosen, known_steps, BATCH))

    def steps(self, batches: Sequence[Batch]) -> list[Step]:
        """Return the steps of batches, in order."""
        return [step for batch in batches for step in steps_of(self.layout.plan, batch)]

    @cached_property
    def reachable(self) -> BoolArray:
        """Mask (N,), without a unit, of the candidates to which a way leads, and back."""
        return np.array([self.layout.reachable(step) for step in self.points])

    @cached_property
    def _forecaster(self) -> Forecaster:
        return Forecaster(self.layout.loaded, self.layout.plan)

    def _current(self, known: Sequence[Step]) -> BoolArray:
        """Candidates (N,) at the present setting of the lamp by hand."""
        block = known[-1].block if known else self.layout.blocks()[0]
        return self._at(block)

    def _at(self, block: int) -> BoolArray:
        """Candidates (N,) at one setting of the lamp by hand."""
        return np.asarray(self.reachable & (self._block == block))

    def _spread(self, chosen: BoolArray, allowed: BoolArray, count: int) -> Chosen:
        """Return up to `count` candidates, each the farthest from those before it."""
        found, so_far = list[int](), chosen.copy()
        for _ in range(count):
            point = farthest_from(self._geometry, so_far, allowed)
            if point is None:
                break
            so_far[point] = True
            found.append(point)
        return [(self.points[k], LACK_OF_FIT) for k in found]

    def _opening(self, known: Sequence[Step]) -> Chosen:
        """Return the first part of points that are spread over all; then, the rest of them.

        Parts in the order of measuring, so that the lamp need not turn back for the second one.
        """
        here = self._current(known)
        spread = self._spread(np.zeros_like(here), here, FIRST + SECOND)
        way = self.layout.way((), [step for step, _ in spread])
        part = way[FIRST:] if known else way[:FIRST]
        done = {step.index for step in known}
        return [(step, LACK_OF_FIT) for step in part if step.index not in done]

    def _spread_on(self, chosen: BoolArray, known: Sequence[Step], size: int) -> Chosen:
        """Return points at the present setting of the lamp by hand, else at the next one."""
        here = self._current(known)
        if np.any(here & ~chosen):
            return self._in_order(self._spread(chosen, here, size), known)
        for block in self._later(known):
            found = self._spread(chosen, self._at(block), _ENTRY)
            if found:
                return self._in_order(found, known)
        return []

    def _in_order(self, points: Chosen, known: Sequence[Step]) -> Chosen:
        """Return points in the order in which they are measured; without those out of reach."""
        reasons = {step.index: why for step, why in points}
        way = self.layout.way(known, [step for step, _ in points])
        return [(step, reasons[step.index]) for step in way]

    def _later(self, known: Sequence[Step]) -> list[int]:
        begun = {step.block for step in known}
        return [block for block in self.layout.blocks() if block not in begun]

    def _informed(
        self,
        known: Knowledge,
        chosen: BoolArray,
        measured: BoolArray,
        steps: Sequence[Step],
        counts: Counts,
        factors: Mapping[str, float],
    ) -> Proposal:
        leading = known.leading
        if leading is None:
            raise ValueError("no model to forecast with")
        model = MODELS[leading.model]
        x = np.array([leading.values[p.name] for p in model.parameters])
        sample = AssumedSample(model, x, "the fit so far")
        every = self._forecaster.of(sample)
        used = every.used
        costs, multiples = self._costs(steps, used), self._multiples(steps)[used]
        choice = NextPoints(every, costs, multiples, known, self.aims)
        by_design = choice.u_measured(measured[used])
        fitted = {name: leading.u.get(name) for name in self.aims.u}
        # Errors that the fit sees beside those of the forecast stay in their ratio.
        ratio = {
            name: 1.0 if u is None else max(u / by_design[name], _LEAST_RATIO)
            for name, u in fitted.items()
        }
        floor, ahead = choice.u_floor(), choice.u_measured(chosen[used])
        full = {name: own * factors.get(name, 1.0) for name, own in ratio.items()}
        points = self._best(choice, used, chosen, steps, counts, full)
        return Proposal(
            known=known,
            points=points,
            forecast={name: ratio[name] * u for name, u in ahead.items()},
            floor={name: ratio[name] * u for name, u in floor.items()},
            sources={name: every.sources(name) for name in self.aims.u},
        )

    def _best(
        self,
        choice: NextPoints,
        used: BoolArray,
        chosen: BoolArray,
        steps: Sequence[Step],
        counts: Counts,
        ratio: Mapping[str, float],
    ) -> Chosen:
        """Return the best points here; those of a later setting by hand if they teach more.

        ratio: u of the fit over that of the forecast.
        """
        usable = np.flatnonzero(used)
        here = (self._current(steps) & ~chosen)[used]
        picks, best = choice.pick(counts, here, ratio) if here.any() else ([], -1.0)
        at = None
        for block in self._later(steps):
            allowed = self._at(block)[used]
            if allowed.any():
                picked, rate = choice.pick(counts, allowed, ratio)
                if rate > best:
                    picks, best, at = picked, rate, block
        if at is not None:  # begin there with points that show a lack of fit
            return self._in_order(self._spread(chosen, self._at(at), _ENTRY), steps)
        points = [
            (self._with_frames(self.points[usable[pick.candidate]], pick.multiple), pick.reason)
            for pick in picks
        ]
        return self._first_part(points, steps, counts)

    @staticmethod
    def _with_frames(step: Step, multiple: int) -> Step:
        return replace(step, frames=step.frames * multiple)

    def _first_part(self, points: Chosen, known: Sequence[Step], counts: Counts) -> Chosen:
        """Return the points of the way to the goal that are measured next, in their order.

        Half of the way, which is then chosen anew from where the rig stands: the last batches are
        small and follow from the most readings. Points for lack of fit that lie farther on are
        among them where a fifth would not be.
        """
        way = self._in_order(points, known)
        whole = counts.way <= BATCH or len(way) <= BATCH + _REST
        if whole or all(why == LACK_OF_FIT for _, why in way):
            return way
        count = min(counts.batch, max(BATCH, math.ceil(_PART * len(way))))
        found, later = way[:count], [one for one in way[count:] if one[1] == LACK_OF_FIT]
        total = sum(step.kind == "point" for step in known) + count
        spread = counts.spread + sum(why == LACK_OF_FIT for _, why in found)
        while later and spread < SHARE * total:
            found.append(later.pop(0))
            total, spread = total + 1, spread + 1
        return found

    def _multiples(self, known: Sequence[Step]) -> IntArray:
        """Frames of each candidate (N,) in units of the protocol's, as a ratio; 0 if not chosen."""
        frames = {step.index: step.frames for step in known}
        return np.array([frames.get(s.index, 0) // s.frames for s in self.points], dtype=np.int64)

    def _costs(self, known: Sequence[Step], used: BoolArray) -> Costs:
        """Return the bench time of the candidates in `used` (N,), from the present pose."""
        layout = self.layout
        points = [step for step, kept in zip(self.points, used, strict=True) if kept]
        numbers = [step.lamp_setting for step in points]
        settings, own = np.unique(numbers, return_inverse=True)
        firsts = {step.lamp_setting: step for step in reversed(points)}
        here = known[-1].pose
        way_s = np.zeros(settings.size)
        for k, number in enumerate(settings.tolist()):
            step = firsts[number]
            lamp = step.pose._replace(theta_r=here.theta_r)
            way_s[k] = min(layout.moves_s(here, lamp), layout.moves_s(here, step.pose))
            if step.block != known[-1].block:  # the operator sets the lamp and places the tile
                tiles = layout.batch([step], known)
                way_s[k] = layout.seconds(tiles, known) - layout.frames_s(step)
        camera_s = float(np.median([_camera_s(step) for step in self.points]))
        return Costs(
            move_s=np.full(len(points), camera_s),
            frames_s=np.array([layout.frames_s(step) for step in points]),
            way_s=way_s,
            setting=own.reshape(-1).astype(np.int64),
            view_deg=np.array([step.pose.theta_r for step in points]),
            here_deg=here.theta_r,
            per_deg_s=self._per_deg_s,
        )

    @cached_property
    def _per_deg_s(self) -> float:
        """Time of a degree that the camera turns, in s; none for one that is set by hand."""
        axis = self.layout.rig.axes.theta_r
        return 0.0 if isinstance(axis, HandAxis) else 1 / axis.speed_deg_per_s


def _camera_s(step: Step) -> float:
    return sum(move.duration_s for move in step.moves if move.axis == "theta_r")
