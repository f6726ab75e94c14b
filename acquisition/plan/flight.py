"""Flights: sweeps in which theta_r turns steadily while the camera exposes, one frame an angle.

Smear. A frame exposed while the axis turns by w shows the mean of the radiance f over that angle,
f + f'' w^2 / 24 to second order: the mean of x^2 over an interval of width w about 0 is w^2 / 12
(Taylor's series). A Gaussian lobe whose full width at half maximum is F has f'' / f = -8 ln 2 / F^2
at its peak, which is lowered by w^2 ln 2 / (3 F^2) of its height. With F the `narrowest_lobe_deg`
and `u_blur` that share, w may be as large as F sqrt(3 u_blur / ln 2).

Speed. The axis turns as fast as that blur, the time of a frame between two angles, the rig file's
speed, and the room for run-up and run-out within limits and keep-out zones allow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Protocol, TypeVar

from acquisition.plan.moves import Move, NoPathError, first_obstacle
from acquisition.plan.pose import Pose
from instrument.config.axes import HandAxis, MotorAxis, Wired
from instrument.config.camera import V4l2CameraConfig
from instrument.config.load import Loaded
from instrument.config.protocol import FlyConfig, SweepConfig, angles_deg
from instrument.config.rig import Rig
from instrument.config.yaml_positions import place
from instrument.errors import InputError

AXIS = "theta_r"
ANY_BLUR = FlyConfig(narrowest_lobe_deg=180.0, u_blur=0.1)
"""For turns whose blur does not matter, as that of the latency."""
_CALIBRATION_DEG, _CALIBRATION_FRAMES = 18.0, 12  # each way
_LOOKS = 3  # frames at rest before a flight
_STEADY_S = 0.05  # at full speed before the first frame, and after the last
_SLACK = 0.98  # share of the time between two angles that a frame may take
_SLOWER, _SLOWEST = 0.9, 0.05  # factor of a speed with too much run-up; share of the first speed
_DEFAULT_FRAMES_PER_S = 30.0  # of a camera whose rig file states none
_ANSWERS, _ANSWER_S = 3, 0.02  # of a controller to each frame, and the usual time of one


class _Step(Protocol):
    @property
    def flight(self) -> int | None: ...


S = TypeVar("S", bound=_Step)


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """Steady turn of theta_r: from rest at `start` to rest at `end`, past all angles of a sweep.

    `speed_deg_per_s` is positive; `run_up_deg` lies before the first angle and after the last.
    `ramp_s`: time to reach the speed.
    """

    start: Pose
    end: Pose
    speed_deg_per_s: float
    run_up_deg: float
    ramp_s: float

    @property
    def sign(self) -> int:
        """1 for a turn towards larger theta_r, else -1."""
        return 1 if self.end.theta_r > self.start.theta_r else -1

    def moves(self, poses: Sequence[Pose]) -> list[tuple[Move, ...]]:
        """Return the turn to each pose, in its turn, and to the end after the last one."""
        speed = self.speed_deg_per_s
        angles = [self.start.theta_r, *(pose.theta_r for pose in poses)]
        ramp_s = self.run_up_deg / speed + self.ramp_s / 2
        times_s = [ramp_s, *(abs(b - a) / speed for a, b in pairwise(angles[1:]))]
        turns: list[tuple[Move, ...]] = [
            (Move(AXIS, a, t),) for a, t in zip(angles[1:], times_s, strict=True)
        ]
        turns[-1] = (*turns[-1], Move(AXIS, self.end.theta_r, ramp_s))
        return turns


def require_flyable(loaded: Loaded) -> None:
    """Raise `InputError` with all reasons why a protocol's `motion: fly` is impossible."""
    problems = list(_problems(loaded)) if loaded.protocol.motion == "fly" else []
    if problems:
        raise InputError(*problems)


def _problems(loaded: Loaded) -> Iterator[str]:
    protocol, axis = loaded.protocol, loaded.rig.axes.theta_r

    def at(*path: str | int) -> str:
        return place(loaded.protocol_path, loaded.protocol_text, path)

    if not axis.reports_while_moving:
        yield (
            f"{at('motion')}: fly, but the driver {axis.driver} of theta_r cannot report its "
            f"position while it moves (see {loaded.rig_path}); allowed: motion: stepped"
        )
    if protocol.frames_per_point != 1:
        yield (
            f"{at('frames_per_point')}: {protocol.frames_per_point}; allowed with motion: fly: 1, "
            "as each frame has an angle of its own: give the sweep more angles instead"
        )
    if protocol.goal is not None:
        yield (
            f"{at('motion')}: fly, and a goal; allowed: one of them, as a flight takes whole "
            "sweeps and a scan with a goal (--until) chooses single geometries"
        )
    for number, sweep in enumerate(protocol.sweeps):
        if text := _not_a_turn(sweep, loaded.rig):
            yield f"{at('sweeps', number)}: {text}"


def _not_a_turn(sweep: SweepConfig, rig: Rig) -> str:
    """Return why the axis cannot turn steadily over a sweep; empty if it can."""
    motors = [key for key in sweep if not isinstance(rig.axes[key.removesuffix("_deg")], HandAxis)]
    if motors and motors[-1] != f"{AXIS}_deg":
        return f"{motors[-1]} is the last axis; allowed with motion: fly: theta_r_deg as the last"
    angles = [float(angle) for angle in angles_deg(sweep["theta_r_deg"])]
    rising = {b > a for a, b in pairwise(angles)}
    if len(angles) < 3 or len(rising) != 1:
        return (
            f"theta_r_deg has {len(angles)} angles; allowed with motion: fly: 3 or more, each "
            "larger than the one before, or each smaller"
        )
    return ""


def runs(poses: Sequence[Pose]) -> list[int]:
    """Return where poses in order split into flights: the number of each flight's first pose.

    In a flight the lamp keeps its place, and theta_r goes on in one direction.
    """
    starts = [0] if poses else []
    rising: bool | None = None
    for number, (before, now) in enumerate(pairwise(poses), 1):
        up = now.theta_r > before.theta_r
        same_lamp = (before.theta_i, before.dphi) == (now.theta_i, now.dphi)
        if same_lamp and rising in (None, up):
            rising = up
        else:
            starts.append(number)
            rising = None
    return starts


def in_turns(steps: Sequence[S]) -> list[list[S]]:
    """Return steps in order, those of one flight together, and all between two flights."""
    groups = groupby(steps, lambda step: step.flight)
    return [list(group) for _, group in groups]


def frame_time_s(exposure_s: float, rig: Rig) -> float:
    """Return the time in seconds from one frame to the next, each with the axis's positions.

    A camera that runs freely finishes the frame under way, and the frame that counts begins within
    a period after that. A controller's answers take some time, too.
    """
    camera, own_s = rig.camera, exposure_s + rig.camera.frame_overhead_s
    asking_s = _ANSWERS * _ANSWER_S if isinstance(rig.axes[AXIS], Wired) else 0.0
    if not isinstance(camera, V4l2CameraConfig):
        return own_s + asking_s
    period_s = max(own_s, 1 / (camera.frames_per_s or _DEFAULT_FRAMES_PER_S))
    return exposure_s + 2 * period_s + asking_s


def largest_blur_deg(fly: FlyConfig) -> float:
    """Return the angle in degrees by which the axis may turn during an exposure."""
    return fly.narrowest_lobe_deg * math.sqrt(3 * fly.u_blur / math.log(2))


def make_flight(
    poses: Sequence[Pose], exposure_s: float, rig: Rig, fly: FlyConfig, pace: float = 1.0
) -> Flight:
    """Return the fastest flight past these poses; raise `NoPathError` without room for run-up.

    pace: factor of the time of a frame, where frames were found to take longer.
    """
    axis = rig.axes[AXIS]
    if isinstance(axis, HandAxis):
        raise InputError(f"{AXIS} is set by hand and cannot turn steadily")
    angles, frame_s = [pose.theta_r for pose in poses], pace * frame_time_s(exposure_s, rig)
    spacing = min((abs(b - a) for a, b in pairwise(angles)), default=math.inf)
    fastest = min(
        axis.speed_deg_per_s, _SLACK * spacing / frame_s, largest_blur_deg(fly) / exposure_s
    )
    speed, obstacle = fastest, ("", "")
    while speed >= _SLOWEST * fastest:
        flight = _at_speed(poses, speed, frame_s, axis)
        found = first_obstacle(flight.start, flight.end, AXIS, rig)
        if found is None:
            return flight
        speed, obstacle = _SLOWER * speed, found
    raise NoPathError(f"turn of {AXIS} from {angles[0]:g} to {angles[-1]:g} deg", *obstacle)


def _at_speed(poses: Sequence[Pose], speed: float, frame_s: float, axis: MotorAxis) -> Flight:
    """Return the flight at a speed in deg/s."""
    run_up = speed**2 / (2 * axis.acceleration_deg_per_s2) + speed * (_STEADY_S + frame_s)
    first, last = poses[0], poses[-1]
    signed = math.copysign(run_up, last.theta_r - first.theta_r)
    if len(poses) == 1:
        signed = run_up
    return Flight(
        start=first._replace(theta_r=first.theta_r - signed),
        end=last._replace(theta_r=last.theta_r + signed),
        speed_deg_per_s=speed,
        run_up_deg=run_up,
        ramp_s=speed / axis.acceleration_deg_per_s2,
    )


def calibration_poses(poses: Sequence[Pose]) -> list[Pose]:
    """Return the poses for a turn there, and in reverse back, that finds the latency of a flight.

    At its more oblique end, where the sample's foreshortening changes most.
    """
    first, last = poses[0], poses[-1]
    if abs(last.theta_r) > abs(first.theta_r):
        first, last = last, first
    way_deg = last.theta_r - first.theta_r
    span_deg = math.copysign(min(abs(way_deg), _CALIBRATION_DEG), way_deg)
    parts = _CALIBRATION_FRAMES - 1
    return [first._replace(theta_r=first.theta_r + span_deg * n / parts) for n in range(parts + 1)]


def preparation_s(poses: Sequence[Pose], exposure_s: float, rig: Rig, *, new: bool) -> float:
    """Return the time in seconds before a flight: for a look, and the latency at its first use."""
    look_s = _LOOKS * frame_time_s(exposure_s, rig)
    if not new:
        return look_s
    there = calibration_poses(poses)
    flight = make_flight(there, exposure_s, rig, ANY_BLUR)
    turn_s = sum(move.duration_s for moves in flight.moves(there) for move in moves)
    return look_s + 2 * turn_s
