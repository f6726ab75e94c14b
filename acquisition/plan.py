"""The plan of a scan: every step, whole and checked, before anything moves.

Protocol and rig in, arrays of steps out; no device is known here. Hand-set axes vary slowest, so
that the operator is asked as seldom as can be; every inner axis runs to and fro (serpentine).
Where camera and lamp hide one another nothing is measured, and the geometries are counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from acquisition.exposure import expected_exposure_s, exposure_ladder_s
from acquisition.motion import Move, NoPathError, Pose, home_pose, moves_between
from instrument.config import Loaded
from instrument.devices import Surface
from instrument.errors import InputError
from instrument.geometry import camera_to_lamp_deg, cone_half_angle_deg
from instrument.protocol_config import Protocol, Sweep, angles_deg
from instrument.record import Kind
from instrument.rig_config import AXES, HandAxis, Rig

HOMING_S = 5.0  # assumed for each motor axis


@dataclass(frozen=True, slots=True)
class Step:
    """One measured geometry: which surface, where, how to get there, when.

    `lamp_setting` numbers the places of the lamp (theta_i, dphi), `block` the times that the
    operator set the lamp by hand; readings are compared with a white tile of the same block.
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


@dataclass(frozen=True, slots=True)
class Plan:
    """All steps in order, and what the operator is told beforehand."""

    steps: tuple[Step, ...]
    hidden: tuple[Pose, ...]
    darks_first_s: tuple[float, ...]
    duration_s: float
    swaps: int
    hand_settings: int

    @property
    def points(self) -> tuple[Step, ...]:
        """The steps that become rows of measurements.csv."""
        return tuple(step for step in self.steps if step.kind == "point")


def make_plan(loaded: Loaded) -> Plan:
    """Plan the whole scan; raises `InputError` when a part of it cannot be done."""
    protocol, rig = loaded.protocol, loaded.rig
    poses = [pose for sweep in protocol.sweeps for pose in sweep_poses(sweep, rig)]
    limit_deg = hidden_below_deg(rig)
    hidden = tuple(pose for pose in poses if _separation_deg(pose) < limit_deg)
    visible = [pose for pose in poses if _separation_deg(pose) >= limit_deg]
    if not visible:
        raise InputError(
            f"{loaded.protocol_path}: sweeps: camera and lamp hide one another (closer than "
            f"{limit_deg:.2f} deg) in all {len(poses)} geometries: choose other angles"
        )
    steps = _with_previews(_in_order(visible, protocol, rig))
    _check_references(steps, limit_deg, loaded)
    return _scheduled(steps, hidden, loaded)


def hidden_below_deg(rig: Rig) -> float:
    """Camera and lamp hide one another when their directions are closer than this."""
    if rig.blocked_half_angle_deg is not None:
        return rig.blocked_half_angle_deg
    return cone_half_angle_deg(rig.source_solid_angle_sr) + cone_half_angle_deg(
        rig.receiver_solid_angle_sr
    )


def sweep_poses(sweep: Sweep, rig: Rig) -> list[Pose]:
    """All poses of one sweep: slowest axis first as written, hand-set axes before motors."""
    names = [key.removesuffix("_deg") for key in sweep]
    names.sort(key=lambda name: not isinstance(rig.axes[name], HandAxis))
    values = {key.removesuffix("_deg"): angles_deg(angles) for key, angles in sweep.items()}
    rows = _serpentine([[float(v) for v in values[name]] for name in names])
    return [Pose(**dict(zip(names, row, strict=True))) for row in rows]


def _serpentine(axes: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """The product of the axes, each inner one running to and fro."""
    if not axes:
        return [()]
    inner = _serpentine(axes[1:])
    return [
        (value, *row)
        for number, value in enumerate(axes[0])
        for row in (inner if number % 2 == 0 else inner[::-1])
    ]


def _separation_deg(pose: Pose) -> float:
    return float(camera_to_lamp_deg(pose.theta_i, pose.theta_r, pose.dphi))


def _in_order(poses: Sequence[Pose], protocol: Protocol, rig: Rig) -> list[Step]:
    """Points with their references, block by block; tile and sample change places once a block."""
    hands = [n for n in ("theta_i", "dphi") if isinstance(rig.axes[n], HandAxis)]
    numbers: dict[tuple[int, float, float], int] = {}
    steps: list[Step] = []
    blocks = groupby(poses, key=lambda pose: tuple(getattr(pose, name) for name in hands))
    for block, (_, group) in enumerate(blocks):
        sample, tile = _block(list(group), protocol)
        for kind, pose in [*tile, *sample] if block % 2 == 0 else [*sample, *tile]:
            key = (block, pose.theta_i, pose.dphi)
            setting = numbers.setdefault(key, len(numbers))
            steps.append(_step(len(steps), kind, pose, setting, block, protocol, rig))
    return steps


def _block(
    poses: list[Pose], protocol: Protocol
) -> tuple[list[tuple[Kind, Pose]], list[tuple[Kind, Pose]]]:
    """The steps on the sample and those on the tile, for one setting of the hand-set axes."""
    tile, drift = protocol.references.white_tile, protocol.references.drift_check
    sample: list[tuple[Kind, Pose]] = [("point", pose) for pose in poses]
    if drift is not None:
        check: tuple[Kind, Pose] = ("drift", poses[0]._replace(theta_r=drift.theta_r_deg))
        starts = range(0, len(poses), drift.every_points)
        sample = [s for n in starts for s in (check, *sample[n : n + drift.every_points])]
        sample.append(check)
    references: list[tuple[Kind, Pose]] = []
    if tile is not None:
        settings = dict.fromkeys((pose.theta_i, pose.dphi) for pose in poses)
        references = [("tile", Pose(*setting, tile.theta_r_deg)) for setting in settings]
    return sample, references


def _step(
    index: int, kind: Kind, pose: Pose, setting: int, block: int, protocol: Protocol, rig: Rig
) -> Step:
    tile = protocol.references.white_tile
    on_tile = kind == "tile" and tile is not None
    return Step(
        index,
        kind,
        "white tile" if on_tile else "sample",
        pose,
        setting,
        block,
        tile.frames if on_tile and tile is not None else protocol.frames_per_point,
        expected_exposure_s(pose.theta_i, 1.0 if on_tile else 0.5, protocol, rig),
    )


def _with_previews(steps: Sequence[Step]) -> list[Step]:
    """Mark the steps whose picture the report shows: both ends and the middle of the first arc."""
    first = next(step.lamp_setting for step in steps if step.kind == "point")
    arc = [s for s in steps if s.kind == "point" and s.lamp_setting == first]
    arc.sort(key=lambda step: step.pose.theta_r)
    middle = min(arc, key=lambda step: abs(step.pose.theta_r))
    chosen = {arc[0].index, middle.index, arc[-1].index}
    return [replace(step, preview=step.index in chosen) for step in steps]


def _check_references(steps: Sequence[Step], limit_deg: float, loaded: Loaded) -> None:
    """A reference that the lamp hides cannot be measured."""
    problems = {
        f"{loaded.protocol_path}: references.{name}.theta_r_deg: {step.pose.theta_r:g} deg is "
        f"hidden by the lamp at theta_i {step.pose.theta_i:g} deg: stay {limit_deg:.2f} deg clear"
        for step in steps
        for kind, name in (("tile", "white_tile"), ("drift", "drift_check"))
        if step.kind == kind and _separation_deg(step.pose) < limit_deg
    }
    if problems:
        raise InputError(*sorted(problems))


def _scheduled(steps: Sequence[Step], hidden: tuple[Pose, ...], loaded: Loaded) -> Plan:
    """Add every step's moves and its time; refuses a way through a keep-out zone."""
    protocol, rig = loaded.protocol, loaded.rig
    by_hand = rig.lamp.darkened_by == "hand"
    darks = exposure_ladder_s(rig.camera) if by_hand else ()
    time_s = _homing_s(rig) + sum(_frames_s(protocol.dark_frames, e, rig) for e in darks)
    time_s += 2 * rig.lamp.cover_s if by_hand else 0.0
    done: list[Step] = []
    problems: list[str] = []
    seen: set[float] = set()
    for step, before in zip(steps, (None, *steps), strict=False):
        start = home_pose(rig) if before is None else before.pose
        try:
            moves = moves_between(start, step.pose, rig)
        except NoPathError as error:
            problems.append(f"{loaded.protocol_path}: sweeps: {error}: see {loaded.rig_path}")
            continue
        duration = _duration_s(step, before, moves, rig)
        if not by_hand and step.expected_exposure_s not in seen:
            seen.add(step.expected_exposure_s)
            duration += _frames_s(protocol.dark_frames, step.expected_exposure_s, rig)
            duration += 2 * rig.lamp.shutter_s
        done.append(replace(step, moves=moves, start_s=time_s, duration_s=duration))
        time_s += duration
    if problems:
        raise InputError(*dict.fromkeys(problems))
    swaps = sum(_swapped(step, before) for step, before in zip(steps, (None, *steps), strict=False))
    hands = sum(isinstance(rig.axes[m.axis], HandAxis) for step in done for m in step.moves)
    return Plan(tuple(done), hidden, tuple(darks), time_s, swaps, hands)


def _homing_s(rig: Rig) -> float:
    return HOMING_S * sum(not isinstance(rig.axes[name], HandAxis) for name in AXES)


def _frames_s(frames: int, exposure_s: float, rig: Rig) -> float:
    return frames * (exposure_s + rig.camera.frame_overhead_s)


def _swapped(step: Step, before: Step | None) -> bool:
    """Whether the operator changes sample and tile before this step (the first places one)."""
    return before is None or before.surface != step.surface


def _duration_s(step: Step, before: Step | None, moves: tuple[Move, ...], rig: Rig) -> float:
    moving = sum(move.duration_s for move in moves)
    swapping = rig.swap_s if _swapped(step, before) else 0.0
    return moving + swapping + _frames_s(step.frames, step.expected_exposure_s, rig)


def lamp_settings(plan: Plan) -> Iterator[tuple[int, float, float]]:
    """Number, theta_i and dphi (degrees) of every place of the lamp, in order."""
    seen = {s.lamp_setting: (s.pose.theta_i, s.pose.dphi) for s in plan.steps}
    yield from ((number, *angles) for number, angles in sorted(seen.items()))
