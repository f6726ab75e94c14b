"""Order of an adaptive scan's steps: references where they are due, points by the shortest way."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from acquisition.plan.moves import NoPathError, moves_between
from acquisition.plan.plan import Plan, Step, frames_s
from acquisition.plan.pose import Pose, home_pose
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.record.reading import Kind


@dataclass(frozen=True, slots=True)
class Layout:
    """Steps of a list of candidates, from which a scan takes some in an order of its own."""

    plan: Plan
    loaded: Loaded

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self.loaded.rig

    def blocks(self) -> list[int]:
        """Return the settings of the lamp by hand, in the order of the list."""
        return list(dict.fromkeys(step.block for step in self.plan.steps))

    def batch(self, points: Iterable[Step], known: Sequence[Step]) -> list[Step]:
        """Return the steps that measure points of one block after those known already.

        The block before is closed and the new one opened where they differ. Points that no way
        leads to are left out.
        """
        points = list(points)
        if not points:
            return []
        block, found = points[0].block, list[Step]()
        if known and known[-1].block != block:
            found += self.closing(known)
        if all(step.block != block for step in known):
            found += self._tiles(block, known)
        way = self.way([*known, *found], points)
        for point in way:
            found += self._drift_due([*known, *found], block)
            found.append(point)
        return found if way else []

    def closing(self, known: Sequence[Step]) -> list[Step]:
        """Return the last drift check of the block that is being measured, and the tile again."""
        if not known:
            return []
        block, found = known[-1].block, list[Step]()
        if self._since_drift(known, block):
            found += self._next("drift", block, known, 1)
        tile = self.loaded.protocol.references.white_tile
        if tile is not None and tile.again_at_end:
            found += self._tiles(block, [*known, *found])
        return found

    def seconds(self, steps: Iterable[Step], known: Sequence[Step] = ()) -> float:
        """Return the expected time of steps after those known; of all, with homing and darks."""
        total = 0.0 if known else self.plan.steps[0].start_s
        pose, surface = self._end(known), known[-1].surface if known else None
        for step in steps:
            total += self.moves_s(pose, step.pose) + self.frames_s(step)
            total += self.rig.swap_s if step.surface != surface else 0.0
            pose, surface = step.pose, step.surface
        return total

    def frames_s(self, step: Step) -> float:
        """Return the expected time of a step's frames."""
        return frames_s(step.frames, step.expected_exposure_s, self.rig)

    def moves_s(self, start: Pose, end: Pose) -> float:
        """Return the time of a move; infinite where no way leads there."""
        try:
            return sum(move.duration_s for move in moves_between(start, end, self.rig))
        except NoPathError:
            return float("inf")

    def reachable(self, point: Step) -> bool:
        """Return True if a way leads to a point from its block's references, and back."""
        own = (s for s in self.plan.steps if s.block == point.block and s.surface == "sample")
        anchor = next(own).pose
        there, back = self.moves_s(anchor, point.pose), self.moves_s(point.pose, anchor)
        return there + back < float("inf")

    def _end(self, known: Sequence[Step]) -> Pose:
        return known[-1].pose if known else home_pose(self.rig)

    def way(self, known: Sequence[Step], points: Iterable[Step]) -> list[Step]:
        """Return the points in an order that is quick to measure, from where the rig stands.

        One setting of the lamp after the other, the nearest first, and the views of each rising or
        falling. Points to which no way leads are left out.
        """
        settings: dict[int, list[Step]] = {}
        for point in sorted(points, key=lambda step: (step.pose.theta_r, step.index)):
            settings.setdefault(point.lamp_setting, []).append(point)
        found, pose = list[Step](), self._end(known)
        while settings:
            orders = [order for own in settings.values() for order in (own, own[::-1])]
            here = pose
            taken = min(orders, key=lambda order: self._reaching_s(here, order))
            reached = self._reached(pose, taken)
            found += reached
            pose = reached[-1].pose if reached else pose
            del settings[taken[0].lamp_setting]
        return found

    def _reaching_s(self, start: Pose, order: Sequence[Step]) -> tuple[float, float]:
        """Return the lamp's time to the setting of an order, and the time of all its moves."""
        lamp = self.moves_s(start, order[0].pose._replace(theta_r=start.theta_r))
        total = 0.0
        for step in order:
            total += self.moves_s(start, step.pose)
            start = step.pose
        return lamp, total

    def _reached(self, start: Pose, order: Sequence[Step]) -> list[Step]:
        """Return the steps of an order to which a way leads from the one before."""
        found = list[Step]()
        for step in order:
            if self.moves_s(start, step.pose) < float("inf"):
                found.append(step)
                start = step.pose
        return found

    def _tiles(self, block: int, known: Sequence[Step]) -> list[Step]:
        """Return one reading of the white tile for each setting of the lamp in a block."""
        settings = {s.lamp_setting for s in self.plan.steps if s.block == block}
        return self._next("tile", block, known, len(settings))

    def _drift_due(self, known: Sequence[Step], block: int) -> list[Step]:
        drift = self.loaded.protocol.references.drift_check
        if drift is None:
            return []
        checked = any(step.kind == "drift" and step.block == block for step in known)
        if checked and self._since_drift(known, block) < drift.every_points:
            return []
        return self._next("drift", block, known, 1)

    @staticmethod
    def _since_drift(known: Sequence[Step], block: int) -> int:
        """Return the number of points of a block since its last drift check."""
        count = 0
        for step in reversed(known):
            if step.block != block or step.kind == "drift":
                break
            count += step.kind == "point"
        return count

    def _next(self, kind: Kind, block: int, known: Sequence[Step], count: int) -> list[Step]:
        """Return the next steps of a kind in a block that are not taken yet, at most `count`."""
        taken = {step.index for step in known}
        own = (s for s in self.plan.steps if (s.kind, s.block) == (kind, block))
        return [step for step in own if step.index not in taken][:count]
