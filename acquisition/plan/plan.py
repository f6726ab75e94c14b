"""The plan of a scan: every step, whole and checked, before anything moves.

Protocol and rig in, arrays of steps out; no device is known here. Hand-set axes vary slowest, so
that the operator is asked as seldom as can be; every inner axis runs to and fro (serpentine).
Where camera and lamp hide one another nothing is measured, and the geometries are counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from acquisition.plan.exposure_ladder import expected_exposure_s, exposure_ladder_s
from acquisition.plan.moves import Move, NoPathError, Pose, home_pose, moves_between
from instrument.config.axes import AXES, HandAxis
from instrument.config.load import Loaded
from instrument.config.protocol import Protocol, SweepConfig, angles_deg
from instrument.config.rig import Rig
from instrument.config.yaml_positions import place
from instrument.devices import Surface
from instrument.errors import InputError
from instrument.geometry import camera_to_lamp_deg, cone_half_angle_deg
from instrument.record.reading import Kind


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
            f"{_place(loaded, 'sweeps')}: camera and lamp hide one another in all {len(poses)} "
            f"geometries; allowed: angles {limit_deg:.2f} deg or more apart"
        )
    steps = _with_previews(_in_order(visible, protocol, rig))
    problems = [*_hidden_references(steps, limit_deg, loaded), *_closed_ways(steps, loaded)]
    if problems:
        raise InputError(*problems)
    return _scheduled(steps, hidden, loaded)


def _place(loaded: Loaded, *path: str) -> str:
    return place(loaded.protocol_path, loaded.protocol_text, path)


def hidden_below_deg(rig: Rig) -> float:
    """Camera and lamp hide one another when their directions are closer than this."""
    cones = (rig.source_solid_angle_sr, rig.receiver_solid_angle_sr)
    return max(rig.blocked_half_angle_deg or 0.0, sum(map(cone_half_angle_deg, cones)))


def sweep_poses(sweep: SweepConfig, rig: Rig) -> list[Pose]:
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
    """Points with their references, block by block; tile and sample change places once a block.

    A block holds all points, of whichever sweep, that one setting of the lamp by hand serves.
    """
    hands = [n for n in ("theta_i", "dphi") if isinstance(rig.axes[n], HandAxis)]
    numbers: dict[tuple[int, float, float], int] = {}
    steps: list[Step] = []
    blocks: dict[tuple[float, ...], list[Pose]] = {}
    for pose in poses:
        blocks.setdefault(tuple(getattr(pose, name) for name in hands), []).append(pose)
    for block, group in enumerate(blocks.values()):
        sample, tile = _block(group, protocol)
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


def _hidden_references(steps: Sequence[Step], limit_deg: float, loaded: Loaded) -> Iterator[str]:
    """A reference that the lamp hides cannot be measured."""
    hidden = [step for step in steps if _separation_deg(step.pose) < limit_deg]
    for kind, name in (("tile", "white_tile"), ("drift", "drift_check")):
        lamps = sorted({step.pose.theta_i for step in hidden if step.kind == kind})
        if lamps:
            view = next(step.pose.theta_r for step in hidden if step.kind == kind)
            yield (
                f"{_place(loaded, 'references', name, 'theta_r_deg')}: {view:g} deg is hidden by "
                f"the lamp at theta_i {', '.join(f'{angle:g}' for angle in lamps)} deg; allowed: "
                f"{limit_deg:.2f} deg or more from the lamp"
            )


def _closed_ways(steps: Sequence[Step], loaded: Loaded) -> Iterator[str]:
    """Moves that no order of the axes can make, one line for each thing in the way."""
    closed: dict[str, list[str]] = {}
    for step, before in zip(steps, (None, *steps), strict=False):
        try:
            moves_between(_start(before, loaded.rig), step.pose, loaded.rig)
        except NoPathError as error:
            closed.setdefault(error.cause, []).append(error.move)
    for moves in closed.values():
        more = f" (and {len(moves) - 1} other moves)" if len(moves) > 1 else ""
        yield f"{_place(loaded, 'sweeps')}: {moves[0]}{more}; see {loaded.rig_path}"


def _start(before: Step | None, rig: Rig) -> Pose:
    return home_pose(rig) if before is None else before.pose


def _scheduled(steps: Sequence[Step], hidden: tuple[Pose, ...], loaded: Loaded) -> Plan:
    """Add every step's moves and its time."""
    rig = loaded.rig
    by_hand = rig.lamp.darkened_by == "hand"
    darks = exposure_ladder_s(rig.camera) if by_hand else ()
    first_s = _homing_s(rig) + (_darks_s(darks, rig.lamp.cover_s, loaded) if by_hand else 0.0)
    time_s, seen, done = first_s, set(darks), []
    for step, before in zip(steps, (None, *steps), strict=False):
        moves = moves_between(_start(before, rig), step.pose, rig)
        duration_s = _duration_s(step, before, moves, rig)
        if step.expected_exposure_s not in seen:
            seen.add(step.expected_exposure_s)
            duration_s += _darks_s((step.expected_exposure_s,), rig.lamp.shutter_s, loaded)
        done.append(replace(step, moves=moves, start_s=time_s, duration_s=duration_s))
        time_s += duration_s
    swaps = sum(_swapped(step, before) for step, before in zip(steps, (None, *steps), strict=False))
    hands = sum(isinstance(rig.axes[m.axis], HandAxis) for step in done for m in step.moves)
    return Plan(tuple(done), hidden, darks, time_s, swaps, hands)


def _darks_s(exposures_s: Sequence[float], cover_s: float, loaded: Loaded) -> float:
    """Darken the lamp, take the darks of these exposures, light it again."""
    frames = loaded.protocol.dark_frames
    return 2 * cover_s + sum(_frames_s(frames, e, loaded.rig) for e in exposures_s)


def _homing_s(rig: Rig) -> float:
    motors = [axis for axis in (rig.axes[name] for name in AXES) if not isinstance(axis, HandAxis)]
    return sum(axis.homing_s for axis in motors)


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
