"""Order of an adaptive scan's steps: references where they are due, points by the shortest way."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial

from acquisition.adaptive.tour import tour
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

    def batch(self, way: Sequence[Step], known: Sequence[Step]) -> list[Step]:
        """Return the steps that measure points of one block, in their order, after those known.

        The block before is closed and the new one opened where they differ. The points are those
        of `way`.
        """
        if not way:
            return []
        block = way[0].block
        found = self._references(block, known)
        return [*found, *self._with_drift(list(way), [*known, *found], block)]

    def _references(self, block: int, known: Sequence[Step]) -> list[Step]:
        """Return the references that come before the points of a block, after those known."""
        found = list[Step]()
        if known and known[-1].block != block:
            found += self.closing(known)
        if all(step.block != block for step in known):
            found += self._tiles(block, known)
        if all((step.kind, step.block) != ("drift", block) for step in known):
            found += self._next("drift", block, known, 1)
        return found

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
        """Return points of one block in the order in which `batch` would measure them.

        Points to which no way leads are left out.
        """
        points = list(points)
        if not points:
            return []
        before = [*known, *self._references(points[0].block, known)]
        return tour(self._end(before), points, self.moves_s)

    def _tiles(self, block: int, known: Sequence[Step]) -> list[Step]:
        """Return one reading of the white tile for each setting of the lamp in a block."""
        settings = {s.lamp_setting for s in self.plan.steps if s.block == block}
        return self._next("tile", block, known, len(settings))

    def _with_drift(self, way: list[Step], known: Sequence[Step], block: int) -> list[Step]:
        """Return points of a block in their order, with the drift checks that fall due.

        Each stands where the detour to it is the shortest, and no later than it is due.
        """
        drift, found = self.loaded.protocol.references.drift_check, list[Step]()
        while drift is not None:
            before = [*known, *found]
            since = self._since_drift(before, block)
            left = self._next("drift", block, before, len(self.plan.steps))
            if since + len(way) <= drift.every_points or not left:
                break
            last = max(drift.every_points - since, 0)
            first = min(int(since == 0), last) if self._spare(before, block, left) else last
            detour_s = partial(self._detour_s, left[0], before, way)
            taken = min(range(first, last + 1), key=detour_s)
            found, way = [*found, *way[:taken], left[0]], way[taken:]
        return [*found, *way]

    def _spare(self, known: Sequence[Step], block: int, left: Sequence[Step]) -> bool:
        """Return True if the drift checks left are enough to take one before it is due."""
        drift = self.loaded.protocol.references.drift_check
        every = len(self.plan.points) if drift is None else drift.every_points
        own = sum(step.block == block for step in self.plan.points)
        done = sum((step.kind, step.block) == ("point", block) for step in known)
        return (len(left) - 2) * every >= own - done

    def _detour_s(
        self, check: Step, known: Sequence[Step], way: Sequence[Step], place: int
    ) -> tuple[float, int]:
        """Return the time of the moves to a check before the point of a place; if equal, later."""
        before, after = (way[place - 1] if place else known[-1]).pose, way[place].pose
        around_s = self.moves_s(before, check.pose) + self.moves_s(check.pose, after)
        return round(around_s - self.moves_s(before, after), 6), -place

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
