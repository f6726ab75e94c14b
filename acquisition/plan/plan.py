"""Plan of a scan: every step, checked as a whole before anything moves.

Protocol and rig in, steps out; devices are unknown here. Hand-set axes vary slowest, so that the
operator is asked as rarely as possible; every inner axis alternates its direction (serpentine).
Geometries in which camera and lamp hide one another are left out and counted. With `motion: fly`
each sweep of theta_r is one steady turn, see `acquisition.plan.flight`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from typing import Protocol as Interface

from acquisition.plan.exposure_ladder import expected_exposure_s, exposure_ladder_s
from acquisition.plan.flight import in_turns, make_flight, preparation_s, require_flyable, runs
from acquisition.plan.moves import Move, NoPathError, moves_between
from acquisition.plan.pose import Pose, home_pose
from acquisition.plan.tile_table import outside_table
from instrument.config.axes import AXES, HandAxis
from instrument.config.load import Loaded
from instrument.config.protocol import Protocol, SweepConfig, angles_deg
from instrument.config.rig import Rig
from instrument.config.yaml_positions import place
from instrument.devices import Surface
from instrument.errors import InputError
from instrument.geometry import cone_half_angle_deg
from instrument.record.reading import Kind

Target = tuple[Kind, Pose]


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One geometry to measure: surface, pose, moves to it, planned start and duration.

    `lamp_setting` numbers the positions of the lamp (theta_i, dphi), `block` its settings by hand;
    a reading is compared with a white tile of the same block. `preview`: the report shows a frame.
    `flight` numbers the steady turns of theta_r; None for a step that is measured at rest.
    """

    index: int
    kind: Kind
    surface: Surface
    pose: Pose
    lamp_setting: int
    block: int
    frames: int
    expected_exposure_s: float
    moves: tuple[Move, ...] = ()
    start_s: float = 0.0
    duration_s: float = 0.0
    preview: bool = False
    flight: int | None = None


class Choosing(Interface):
    """Choice among the steps of a plan while the scan runs, batch by batch."""

    @property
    def steps(self) -> Sequence[Step]:
        """Steps chosen so far, in the order in which they are measured."""

    @property
    def ended(self) -> bool:
        """True if nothing will be chosen any more."""

    def more(self) -> Sequence[Step]:
        """Choose the next batch, and record it; empty at the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """All steps in order, with the totals shown to the operator beforehand.

    `hidden`: poses left out. `darks_first_s`: exposures whose darks are taken before the first
    step. `swaps`: changes between sample and white tile. `hand_settings`: axes to set by hand.
    `choosing`: who chooses among the steps, of which then only some are measured, in another order.
    """

    steps: tuple[Step, ...]
    hidden: tuple[Pose, ...]
    darks_first_s: tuple[float, ...]
    duration_s: float
    swaps: int
    hand_settings: int
    choosing: Choosing | None = None

    @property
    def known(self) -> Sequence[Step]:
        """The steps to measure as far as they are known, in the order of measuring."""
        return self.steps if self.choosing is None else self.choosing.steps

    @property
    def growing(self) -> bool:
        """True if more steps may be chosen."""
        return self.choosing is not None and not self.choosing.ended

    def more(self) -> Sequence[Step]:
        """Choose further steps; empty where all are known."""
        return () if self.choosing is None else self.choosing.more()

    @property
    def points(self) -> tuple[Step, ...]:
        """The steps that become rows of measurements.csv."""
        return tuple(step for step in self.steps if step.kind == "point")

    def moves_to(self, step: Step, pose: Pose, rig: Rig) -> tuple[Move, ...]:
        """Return the moves from `pose` to a step: as planned if `pose` is where the plan starts.

        Raises `NoPathError` if no order of the axes is clear.
        """
        start = self.steps[step.index - 1].pose if step.index > 0 else home_pose(rig)
        return step.moves if pose == start else moves_between(pose, step.pose, rig)


def make_plan(loaded: Loaded) -> Plan:
    """Plan the whole scan; raise `InputError` if any part of it is impossible."""
    protocol, rig = loaded.protocol, loaded.rig
    require_flyable(loaded)
    poses = [pose for sweep in protocol.sweeps for pose in sweep_poses(sweep, rig)]
    limit_deg = min_separation_deg(rig)
    hidden = tuple(pose for pose in poses if pose.separation_deg < limit_deg)
    visible = [pose for pose in poses if pose.separation_deg >= limit_deg]
    if not visible:
        raise InputError(
            f"{_position(loaded, 'sweeps')}: camera and lamp hide one another in all {len(poses)} "
            f"geometries; allowed: angles {limit_deg:.2f} deg or more apart"
        )
    steps = _with_previews(_numbered_flights(_ordered_steps(visible, protocol, rig), protocol))
    steps, blocked = _with_moves(steps, loaded)
    tiles = [step.pose for step in steps if step.kind == "tile"]
    problems = [
        *_hidden_references(steps, limit_deg, loaded),
        *outside_table(tiles, loaded),
        *blocked,
    ]
    if problems:
        raise InputError(*problems)
    return _schedule(steps, hidden, loaded)


def _position(loaded: Loaded, *path: str) -> str:
    return place(loaded.protocol_path, loaded.protocol_text, path)


def min_separation_deg(rig: Rig) -> float:
    """Return the angle between camera and lamp below which they hide one another."""
    cones = (rig.source_solid_angle_sr, rig.receiver_solid_angle_sr)
    return max(rig.blocked_half_angle_deg or 0.0, sum(map(cone_half_angle_deg, cones)))


def sweep_poses(sweep: SweepConfig, rig: Rig) -> list[Pose]:
    """Return all poses of one sweep: slowest axis first as written, hand-set axes before motors."""
    names = [key.removesuffix("_deg") for key in sweep]
    names.sort(key=lambda name: not isinstance(rig.axes[name], HandAxis))
    values = {key.removesuffix("_deg"): angles_deg(angles) for key, angles in sweep.items()}
    rows = _serpentine([[float(v) for v in values[name]] for name in names])
    return [Pose(**dict(zip(names, row, strict=True))) for row in rows]


def _serpentine(axes: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Return the product of the axes, each inner one alternating its direction."""
    if not axes:
        return [()]
    inner = _serpentine(axes[1:])
    return [
        (value, *row)
        for number, value in enumerate(axes[0])
        for row in (inner if number % 2 == 0 else inner[::-1])
    ]


def _ordered_steps(poses: Sequence[Pose], protocol: Protocol, rig: Rig) -> list[Step]:
    """Return points and references block by block; tile and sample are swapped once a block.

    A block holds all points, of whichever sweep, that share one setting of the lamp by hand. With
    `again_at_end` it begins and ends with the tile.
    """
    tile = protocol.references.white_tile
    closed = tile is not None and tile.again_at_end
    by_hand = [n for n in ("theta_i", "dphi") if isinstance(rig.axes[n], HandAxis)]
    numbers: dict[tuple[int, float, float], int] = {}
    steps: list[Step] = []
    blocks: dict[tuple[float, ...], list[Pose]] = {}
    for pose in poses:
        blocks.setdefault(tuple(getattr(pose, name) for name in by_hand), []).append(pose)
    for block, group in enumerate(blocks.values()):
        sample, white = _block(group, protocol)
        first, then = (white, sample) if closed or block % 2 == 0 else (sample, white)
        for kind, pose in [*first, *then, *(white if closed else [])]:
            setting = numbers.setdefault((block, pose.theta_i, pose.dphi), len(numbers))
            steps.append(_step(len(steps), kind, pose, setting, block, protocol, rig))
    return steps


def _block(poses: list[Pose], protocol: Protocol) -> tuple[list[Target], list[Target]]:
    """Return the targets on the sample and those on the tile for one setting by hand."""
    tile, drift = protocol.references.white_tile, protocol.references.drift_check
    sample: list[Target] = [("point", pose) for pose in poses]
    if drift is not None:
        check: Target = ("drift", poses[0]._replace(theta_r=drift.theta_r_deg))
        starts = _check_starts(poses, protocol, drift.every_points)
        parts = pairwise([*starts, len(poses)])
        sample = [s for begin, end in parts for s in (check, *sample[begin:end])]
        sample.append(check)
    if tile is None:
        return sample, []
    settings = dict.fromkeys((pose.theta_i, pose.dphi) for pose in poses)
    return sample, [("tile", Pose(*setting, tile.theta_r_deg)) for setting in settings]


def _check_starts(poses: Sequence[Pose], protocol: Protocol, every: int) -> Sequence[int]:
    """Return the numbers of the poses before which the drift is checked; no check cuts a flight."""
    if protocol.motion == "stepped":
        return range(0, len(poses), every)
    starts = [0]
    for start in runs(poses)[1:]:
        if start - starts[-1] >= every:
            starts.append(start)
    return starts


def _numbered_flights(steps: Sequence[Step], protocol: Protocol) -> list[Step]:
    """Number the flights of a scan with `motion: fly`."""
    if protocol.motion == "stepped":
        return list(steps)
    numbered, flight = [], -1
    for kind, group in groupby(steps, lambda step: step.kind):
        own = list(group)
        starts = set(runs([step.pose for step in own]) if kind == "point" else ())
        for number, step in enumerate(own):
            flight += number in starts
            numbered.append(replace(step, flight=flight if kind == "point" else None))
    return numbered


def _step(
    index: int, kind: Kind, pose: Pose, setting: int, block: int, protocol: Protocol, rig: Rig
) -> Step:
    tile = protocol.references.white_tile if kind == "tile" else None
    reflectance = 0.5 if tile is None else 1.0  # the sample's is not known yet
    return Step(
        index=index,
        kind=kind,
        surface="sample" if tile is None else "white tile",
        pose=pose,
        lamp_setting=setting,
        block=block,
        frames=protocol.frames_per_point if tile is None else tile.frames,
        expected_exposure_s=expected_exposure_s(pose.theta_i, reflectance, protocol, rig),
    )


def _with_previews(steps: Sequence[Step]) -> list[Step]:
    """Mark the steps whose frame the report shows: both ends and the middle of the first arc."""
    first = next(step.lamp_setting for step in steps if step.kind == "point")
    arc = [s for s in steps if s.kind == "point" and s.lamp_setting == first]
    arc.sort(key=lambda step: step.pose.theta_r)
    middle = min(arc, key=lambda step: abs(step.pose.theta_r))
    chosen = {arc[0].index, middle.index, arc[-1].index}
    return [replace(step, preview=step.index in chosen) for step in steps]


def _with_moves(steps: Sequence[Step], loaded: Loaded) -> tuple[list[Step], list[str]]:
    """Add the moves to each step; return the steps, and one line for each obstacle met."""
    obstacles: dict[str, list[str]] = {}
    start, moved = home_pose(loaded.rig), list[Step]()
    for group in _moving_together(steps):
        try:
            own, start = _moved(group, start, loaded)
            moved += own
        except NoPathError as error:
            obstacles.setdefault(error.cause, []).append(error.move)
            moved += group
            start = group[-1].pose
    return moved, [_blocked(loaded, moves) for moves in obstacles.values()]


def _moving_together(steps: Sequence[Step]) -> Iterator[Sequence[Step]]:
    for group in in_turns(steps):
        yield from [group] if group[0].flight is not None else [[step] for step in group]


def _moved(group: Sequence[Step], start: Pose, loaded: Loaded) -> tuple[list[Step], Pose]:
    """Return a step, or those of a flight, with their moves, and where these end."""
    rig, first = loaded.rig, group[0]
    if first.flight is None:
        return [replace(first, moves=moves_between(start, first.pose, rig))], first.pose
    poses = [step.pose for step in group]
    flight = make_flight(poses, first.expected_exposure_s, rig, loaded.protocol.fly)
    moves = (*moves_between(start, flight.start, rig), *flight.moves(poses)[0])
    rest = zip(group[1:], flight.moves(poses)[1:], strict=True)
    new = first.flight == 0
    wait_s = preparation_s(poses, first.expected_exposure_s, rig, new=new)
    own = [
        replace(first, moves=moves, duration_s=wait_s),
        *(replace(step, moves=turn) for step, turn in rest),
    ]
    return own, flight.end


def _blocked(loaded: Loaded, moves: Sequence[str]) -> str:
    more = f" (and {len(moves) - 1} other moves)" if len(moves) > 1 else ""
    return f"{_position(loaded, 'sweeps')}: {moves[0]}{more}; see {loaded.rig_path}"


def _hidden_references(steps: Sequence[Step], limit_deg: float, loaded: Loaded) -> Iterator[str]:
    """Yield one line for each kind of reference that the lamp hides at some incidence."""
    hidden = [step for step in steps if step.pose.separation_deg < limit_deg]
    for kind, name in (("tile", "white_tile"), ("drift", "drift_check")):
        lamps = sorted({step.pose.theta_i for step in hidden if step.kind == kind})
        if lamps:
            view = next(step.pose.theta_r for step in hidden if step.kind == kind)
            yield (
                f"{_position(loaded, 'references', name, 'theta_r_deg')}: {view:g} deg is hidden "
                f"by the lamp at theta_i {', '.join(f'{angle:g}' for angle in lamps)} deg; "
                f"allowed: {limit_deg:.2f} deg or more from the lamp"
            )


def _schedule(steps: Sequence[Step], hidden: tuple[Pose, ...], loaded: Loaded) -> Plan:
    """Return the plan, with the start and duration of every step predicted."""
    rig = loaded.rig
    time_s, darks_first_s = _homing_s(rig), tuple[float, ...]()
    if rig.lamp.darkened_by == "hand":
        darks_first_s = exposure_ladder_s(rig.camera)
        time_s += _darks_s(darks_first_s, rig.lamp.cover_s, loaded)
    swaps, taken_s, scheduled = 0, set(darks_first_s), []
    surface: Surface | None = None
    for step in steps:
        duration_s = step.duration_s + sum(move.duration_s for move in step.moves)
        if step.surface != surface:  # the operator swaps sample and tile, or places the first
            swaps, surface, duration_s = swaps + 1, step.surface, duration_s + rig.swap_s
        if step.flight is None:
            duration_s += frames_s(step.frames, step.expected_exposure_s, rig)
        if step.expected_exposure_s not in taken_s:
            taken_s.add(step.expected_exposure_s)
            duration_s += _darks_s((step.expected_exposure_s,), rig.lamp.shutter_s, loaded)
        scheduled.append(replace(step, start_s=time_s, duration_s=duration_s))
        time_s += duration_s
    hands = sum(isinstance(rig.axes[m.axis], HandAxis) for step in steps for m in step.moves)
    return Plan(
        steps=tuple(scheduled),
        hidden=hidden,
        darks_first_s=darks_first_s,
        duration_s=time_s,
        swaps=swaps,
        hand_settings=hands,
    )


def _darks_s(exposures_s: Sequence[float], cover_s: float, loaded: Loaded) -> float:
    """Return the duration of darkening, the darks of these exposures, and lighting again."""
    frames = loaded.protocol.dark_frames
    return 2 * cover_s + sum(frames_s(frames, e, loaded.rig) for e in exposures_s)


def _homing_s(rig: Rig) -> float:
    axes = (rig.axes[name] for name in AXES)
    return sum(axis.homing_s for axis in axes if not isinstance(axis, HandAxis))


def frames_s(frames: int, exposure_s: float, rig: Rig) -> float:
    """Return the time in seconds that so many frames take."""
    return frames * (exposure_s + rig.camera.frame_overhead_s)
