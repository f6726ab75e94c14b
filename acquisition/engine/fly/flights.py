"""Steady turns of theta_r past the angles of a sweep, one frame at each.

Before the turn, at rest on its run-up, the exposure is chosen and checked by light as in a stepped
scan, its dark is taken, and at a first use the latency is found. Angles whose frame is saturated,
or that went by meanwhile, are flown past again. A pause, or a stop, ends a turn where it is; what
is missing then is flown from the first missing angle on.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.engine.axis import Axis
from acquisition.engine.exposure.exposer import Exposed, Exposer, Turn
from acquisition.engine.fly.latency import Latency, latency_of
from acquisition.engine.fly.turning import Shot, sample
from acquisition.engine.frame_reduction import FrameReduction
from acquisition.engine.pause import Paused, PauseSwitch
from acquisition.engine.positioner import Positioner
from acquisition.measure.radiometry import SATURATION_FRACTION
from acquisition.plan.flight import ANY_BLUR, AXIS, Flight, calibration_poses, make_flight
from acquisition.plan.plan import Step
from acquisition.plan.pose import Pose
from instrument.clock import Clock
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.errors import ComputerPaused, DeviceError, Interlock
from instrument.record.event_kinds import LATENCY
from instrument.record.reading import Reading

log = logging.getLogger(__name__)
interlocks = logging.getLogger("acquisition.interlocks")

TURNS = 6  # over the angles of one sweep, before the scan gives up on what is missing
# Of the target: a known exposure within these shares needs no other, and no calibration.
_KEEP = (0.35, 1.25)
_ENOUGH, _SLOWER = 0.9, 1.5  # share of angles with a frame; factor of the time of a frame
_LEAST_WAIT_S = 0.001
_STUCK_S = 0.5  # without progress the axis has stopped


@dataclass(slots=True, kw_only=True)
class Flights:
    """Flies past the angles of steps.

    `begin_step` announces a step to a simulated scene. `accept` takes a reading with its frames.
    `note` records an event.
    """

    protocol: Protocol
    rig: Rig
    clock: Clock
    axis: Axis
    positioner: Positioner
    exposer: Exposer
    reduction: FrameReduction
    pause: PauseSwitch
    begin_step: Callable[[Step], None]
    accept: Callable[[Exposed, Reading], None]
    note: Callable[[str, str], None]
    _latencies: dict[float, Latency] = field(default_factory=dict, init=False)
    _brightest: float = field(default=0.0, init=False)  # counts per second in the last sweep
    _contradicted: set[int] = field(default_factory=set, init=False)
    _pace: float = field(default=1.0, init=False)
    _sweep: Sequence[Step] = field(default=(), init=False)
    _done: set[int] = field(default_factory=set, init=False)  # of the sweep's steps

    def fly(self, steps: Sequence[Step]) -> None:
        """Measure the steps of a sweep; raise `Paused` if the operator wants a pause."""
        self._sweep, self._done = steps, set()
        for _ in range(TURNS):
            missing = [step for step in steps if step.index not in self._done]
            if not missing:
                return
            self._turn_past(missing)
        raise DeviceError(
            f"{AXIS}: {len(missing)} of {len(steps)} angles were missed in {TURNS} turns, the "
            f"first at {missing[0].pose.theta_r:g} deg: frames take longer than the rig file says "
            "(frame_overhead_s, frames_per_s), or are saturated at the shortest exposure; correct "
            "it, give the sweep fewer angles, or measure with motion: stepped"
        )

    def _turn_past(self, steps: Sequence[Step]) -> None:
        """Turn once past the steps."""
        self._require_no_pause()
        self.begin_step(steps[0])
        try:
            exposure_s = self._prepare(steps)
            latency = self._latencies.get(exposure_s) or self._calibrated(exposure_s)
            flight = self._flight([step.pose for step in steps], exposure_s)
            self.positioner.move_to(flight.start)
            self._measure(steps, flight, latency)
        except ComputerPaused as pause:
            self.positioner.stand_after(AXIS, pause)

    def _flight(self, poses: Sequence[Pose], exposure_s: float) -> Flight:
        return make_flight(poses, exposure_s, self.rig, self.protocol.fly, self._pace)

    def _prepare(self, steps: Sequence[Step]) -> float:
        """Stand on the run-up, look, and set the exposure; return it as the camera took it.

        The run-up is that of the exposure before: if the light allows it again, the axis is there.
        """
        first = steps[0]
        likely_s = self.exposer.set_s or first.expected_exposure_s  # 0 before the first turn
        flight = self._flight([s.pose for s in steps], likely_s)
        self.positioner.move_to(flight.start)
        window = self.reduction.window(flight.start)
        look = replace(first, pose=flight.start, preview=False)
        seen = self._rate(self.reduction.reading(self.exposer.expose(look, window)))
        self.positioner.require_in_place()
        rate = max(seen, self._brightest)
        fitting = [e for e in self._latencies if self._is_suitable(rate, e)]
        exposure_s = max(fitting) if fitting else self.exposer.exposure_s(rate)
        return self.exposer.prepare(exposure_s, window)

    def _rate(self, reading: Reading) -> float:
        """Return the brightness in counts per second; of a saturated picture a guess."""
        rate = (reading.peak_dn - self.rig.camera.black_level_dn) / reading.exposure_s
        return rate * (4 if self._is_saturated(reading) else 1)

    def _is_saturated(self, reading: Reading) -> bool:
        return reading.peak_dn >= SATURATION_FRACTION * self.rig.camera.max_dn

    def _is_suitable(self, rate: float, exposure_s: float) -> bool:
        low, high = _KEEP
        return low <= rate * exposure_s / self.exposer.target_dn <= high

    def _calibrated(self, exposure_s: float) -> Latency:
        """Find the latency at an exposure by a turn there and back, where the view is oblique."""
        there = calibration_poses([step.pose for step in self._sweep])
        for _ in range(TURNS):
            turns = self._fast_turn(there, exposure_s), self._fast_turn(there[::-1], exposure_s)
            if not self._was_too_fast(2 * len(there), sum(map(len, turns))):
                break
        found = latency_of(
            turns,
            lambda angle_deg: self.reduction.window(there[0]._replace(theta_r=angle_deg)),
            self.exposer.dark(exposure_s),
            self.rig.camera,
        )
        self._latencies[exposure_s] = found
        self.note(LATENCY, found.text(exposure_s))
        return found

    def _fast_turn(self, poses: Sequence[Pose], exposure_s: float) -> list[Shot]:
        flight = make_flight(poses, exposure_s, self.rig, ANY_BLUR, self._pace)
        self.positioner.move_to(flight.start)
        return [shot for _, shot in self._shots(poses, flight)]

    def _was_too_fast(self, angles: int, frames: int) -> bool:
        """Return True, and turn more slowly from now on, where angles went by without a frame."""
        if frames >= _ENOUGH * angles:
            return False
        self._pace *= _SLOWER
        log.warning(
            "%s: %d of %d angles went by without a frame, which takes longer than the rig file "
            "says: turns %g times more slowly", AXIS, angles - frames, angles, _SLOWER,
        )  # fmt: skip
        return True

    def _measure(self, steps: Sequence[Step], flight: Flight, latency: Latency) -> None:
        """Turn past the steps and have their readings accepted."""
        self._brightest, frames = 0.0, 0
        for number, shot in self._shots([step.pose for step in steps], flight, steps):
            frames += 1
            exposed = self._exposed(steps[number], shot, latency)
            if exposed is None:
                continue
            reading = self.reduction.reading(exposed)
            self._brightest = max(self._brightest, self._rate(reading))
            shorter = self.exposer.exposure_s(self._brightest) < reading.exposure_s
            if self._is_saturated(reading) and shorter:
                continue  # flown past again, with a shorter exposure
            self.accept(exposed, reading)
            self._done.add(steps[number].index)
        self._was_too_fast(len(steps), frames)

    def _shots(
        self, poses: Sequence[Pose], flight: Flight, steps: Sequence[Step] = ()
    ) -> Iterator[tuple[int, Shot]]:
        """Turn past the poses; yield the number of each that did not go by, and its frame."""
        speed = flight.sign * flight.speed_deg_per_s
        self.positioner.start_turn(AXIS, flight.end, flight.speed_deg_per_s)
        camera = self.rig.camera
        lead_s = camera.frame_overhead_s + self.exposer.set_s / 2
        for number, pose in enumerate(poses):
            if steps:
                self._require_no_pause()
            if not self._reached(pose.theta_r - speed * lead_s, flight):
                continue
            if steps:
                self.begin_step(steps[number])
            shot = self._shot(speed)
            if not shot.is_even(self.rig.axes[AXIS].tolerance_deg):
                if self._has_arrived(flight):
                    break  # the frame came when the axis had gone by: of a camera that was lost
                self._refuse_uneven(shot)
            lead_s = shot.middle_s - shot.before.time_s
            yield number, shot
        self.positioner.finish_turn(AXIS)

    def _shot(self, speed: float) -> Shot:
        before = sample(self.axis, self.clock)
        frame = self.exposer.camera.grab(1)[0]
        return Shot(frame, before, sample(self.axis, self.clock), speed)

    def _reached(self, angle_deg: float, flight: Flight) -> bool:
        """Wait until the axis is at an angle; return False if it is past it by a frame's turn."""
        sign, speed = flight.sign, flight.speed_deg_per_s
        left_deg = sign * (angle_deg - self.axis.position_deg())
        late_deg = speed * self.exposer.set_s + self.rig.axes[AXIS].tolerance_deg
        if left_deg < -late_deg:
            return False
        progress_s, before_deg = self.clock.now_s(), left_deg
        while left_deg > 0:
            self.clock.sleep(max(min(left_deg / speed, _STUCK_S / 5), _LEAST_WAIT_S))
            left_deg = sign * (angle_deg - self.axis.position_deg())
            now_s = self.clock.now_s()
            if left_deg < before_deg:
                progress_s, before_deg = now_s, left_deg
            elif now_s - progress_s > _STUCK_S:
                self._explain_standstill(angle_deg)
        return True

    def _explain_standstill(self, angle_deg: float) -> None:
        """Raise what has stopped the axis: the driver knows it."""
        self.positioner.finish_turn(AXIS)
        raise DeviceError(
            f"{AXIS}: did not come past {angle_deg:g} deg on its turn: look at its latency and at "
            "what holds the stage"
        )

    def _has_arrived(self, flight: Flight) -> bool:
        left_deg = flight.sign * (flight.end.theta_r - self.axis.position_deg())
        return left_deg < flight.run_up_deg

    def _refuse_uneven(self, shot: Shot) -> None:
        raise DeviceError(
            f"{AXIS}: turned by {shot.unevenness_deg():+.3f} deg more than commanded while a frame "
            f"was taken at {shot.reported_deg:.2f} deg, which does not count: look for what holds "
            "or moves the stage"
        )

    def _exposed(self, step: Step, shot: Shot, latency: Latency) -> Exposed | None:
        """Return a frame with its mean angle; None if it contradicts the pose, the first time."""
        late_deg = shot.speed_deg_per_s * latency.value_s
        pose = step.pose._replace(theta_r=round(shot.reported_deg + late_deg, 4))
        # The feature shows the axis's own error as well, which counts by itself.
        jitter = max(latency.u_angle_deg**2 - self.rig.axes[AXIS].u_deg ** 2, 0.0)
        turn = Turn(
            blur_deg=shot.blur_deg,
            u_deg=float(np.sqrt(shot.u_deg**2 + jitter)),
            u_latency_deg=shot.speed_deg_per_s * latency.u_s,
        )
        text = self.exposer.contradiction(shot.frame, replace(step, pose=pose))
        if text and step.index in self._contradicted:
            raise Interlock(text)
        if text:
            self._contradicted.add(step.index)
            interlocks.warning("%s. It is measured again", text)
            return None
        return self.exposer.flown(replace(step, pose=pose), shot.frame, turn)

    def _require_no_pause(self) -> None:
        if self.pause.is_on:
            self.positioner.break_off(AXIS)
            raise Paused
