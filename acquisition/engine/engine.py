"""Engine of a scan: move, settle, expose; reduce and record while the next move is under way.

Devices are known only by their interfaces. Every reading is on disk before the next move counts as
done, and is written by a thread of the record: a disk that hangs holds up no motion and no stop.
However a scan ends, motion is stopped and the lamp darkened, and this process moves nothing again:
only the operator may resume the scan.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

from acquisition.engine.axis import Axis
from acquisition.engine.exposure.exposer import Exposed, Exposer
from acquisition.engine.fly.flights import Flights
from acquisition.engine.frame_files import write_kept
from acquisition.engine.frame_reduction import FrameReduction
from acquisition.engine.onlookers import MEASURING, KnownLamp, Phase, Present
from acquisition.engine.pause import Paused, PauseSwitch
from acquisition.engine.positioner import Positioner
from acquisition.engine.preview import make_preview
from acquisition.engine.resume import Progress, report_found
from acquisition.engine.retrying_camera import RetryingCamera
from acquisition.interlocks.frame_scatter import FrameScatter
from acquisition.interlocks.lamp_checks import check_text, failed
from acquisition.interlocks.references import References, what_to_look_at
from acquisition.interlocks.watched_camera import WatchedCamera
from acquisition.measure.drift import is_usable
from acquisition.measure.window import Window
from acquisition.plan.flight import AXIS, in_turns
from acquisition.plan.moves import NoPathError
from acquisition.plan.plan import Plan, Step
from instrument.clock import Clock
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Camera, Lamp, Operator, Surface
from instrument.errors import DeviceError, Interlock, WrongRigFile
from instrument.record.event_kinds import DRIFT, INTERLOCK, OPERATOR, PLATE
from instrument.record.reading import Reading
from instrument.record.record import Record

log = logging.getLogger("acquisition.interlocks")

ATTEMPTS = 2  # at a drift check or a reading of the white tile, before it ends the scan


@dataclass(frozen=True, slots=True)
class Devices:
    """Devices that the engine drives.

    `begin_step` passes a step's index and the scan time to a simulated scene. `close` releases all
    devices.
    """

    axes: dict[str, Axis]
    camera: Camera
    lamp: Lamp
    operator: Operator
    clock: Clock
    begin_step: Callable[[int, float], None]
    close: Callable[[], None] = lambda: None


class Engine:
    """Runs the steps of a plan.

    `on_step` is called with each step once it is on disk, `on_frames` with its frames as soon as
    they are there. `pause`: switch with which the operator pauses the scan.
    """

    def __init__(
        self,
        protocol: Protocol,
        rig: Rig,
        devices: Devices,
        record: Record,
        on_step: Callable[[Step], None],
        *,
        on_frames: Callable[[Exposed, Window], None] = lambda *_: None,
        pause: PauseSwitch | None = None,
    ) -> None:
        self._protocol, self._rig, self._devices = protocol, rig, devices
        self._record, self._on_step, self._on_frames = record, on_step, on_frames
        self._pause = pause or PauseSwitch()
        self._phase: Phase = "homing"
        self._step: Step | None = None
        self._lamp = KnownLamp(devices.lamp)
        self._ended = False
        self._references = References(rig, protocol.references.white_tile)
        note = partial(self._add_event, OPERATOR)
        self._positioner = Positioner(rig, devices.axes, self._lamp, devices.operator, note)
        scatter = FrameScatter(rig, partial(self._add_event, INTERLOCK))
        self._reduction = FrameReduction(rig, protocol, scatter, partial(self._add_event, PLATE))
        self._begun_step = (0, 0.0, 0.0)  # its index, and its begin in scan time and running time
        wait_s, clock = rig.camera.reconnect_s, devices.clock
        self._camera = WatchedCamera(devices.camera, rig.camera)
        camera = RetryingCamera(self._camera, clock, wait_s, self._continue_step)
        self._exposer = Exposer(
            camera, self._lamp, clock, protocol, rig, record, self._continue_step
        )
        self._flights = Flights(
            protocol=protocol, rig=rig, clock=clock, axis=devices.axes[AXIS], note=self._add_event,
            positioner=self._positioner, exposer=self._exposer, reduction=self._reduction,
            pause=self._pause, begin_step=self._announce, accept=self._accept_flown,
        )  # fmt: skip

    def run(self, plan: Plan, progress: Progress | None = None) -> None:
        """Run all steps, or resume a stopped scan with the steps missing from its progress.

        Leaves a safe rig behind in every case, and refuses (`DeviceError`) to run again.
        """
        if self._ended:
            raise DeviceError(
                "the scan has ended and the rig was made safe: nothing moves again before the "
                "operator has said so: gonio resume"
            )
        try:
            self._register_devices()
            if progress is None:
                self._begin(plan)
                self._measure_all(plan, partial(self._measure, plan))
            else:
                self._restore(plan, progress)
                self._measure_all(plan, partial(self._go_on, plan, progress))
        finally:
            self._ended, self._phase = True, "ending"
            self._positioner.make_safe()

    def present(self) -> Present:
        """Return the present state of scan and rig; from any thread."""
        positioner, lamp, phase = self._positioner, self._lamp, self._phase
        asked = positioner.asked
        if lamp.asked and self._rig.lamp.darkened_by == "hand":
            asked = "Cover the lamp" if lamp.asked == "darkened" else "Uncover the lamp"
        if phase in MEASURING:
            phase = "operator" if asked else "pausing" if self._pause.is_on else phase
        return Present(
            phase=phase,
            step=self._step,
            pose=positioner.pose,
            target=positioner.target,
            moving=positioner.moving,
            surface=positioner.surface,
            lamp=lamp.state,
            asked=asked,
        )

    def _register_devices(self) -> None:
        devices = self._devices
        named: dict[str, Camera | Axis] = {"camera": devices.camera, **devices.axes}
        for role, device in named.items():
            self._register(role, device.identity())
        self._register("lamp", devices.lamp.identity())
        self._camera.expect(self._record.settings().get("camera", {}))
        for role, device in named.items():
            self._record.add_settings(devices.clock.utc().isoformat(), role, device.settings())

    def _register(self, role: str, identity: str) -> None:
        """Record a device's identity; a resumed scan requires the one of its beginning."""
        before = self._record.devices().get(role)
        if before not in (None, identity):
            raise DeviceError(
                f"{role}: {identity!r} answers, but the scan began with {before!r}: connect that "
                "one again, or start a new run. Nothing has moved"
            )
        self._record.add_device(role, identity)

    def _begin(self, plan: Plan) -> None:
        """Home the axes and take the darks for which the operator covers the lamp."""
        self._positioner.home()
        self._positioner.open_shutter()
        self._exposer.start_clock(0.0)
        self._exposer.take_darks(plan.darks_first_s, self._reduction.window(self._positioner.pose))

    def _restore(self, plan: Plan, progress: Progress) -> None:
        """Restore the state in which the scan stopped, apart from its pose."""
        report_found(self._positioner.recover_position(), progress, self._rig)
        self._positioner.open_shutter()
        self._exposer.restore(progress.by_time)
        self._exposer.take_darks(plan.darks_first_s, self._reduction.window(self._positioner.pose))

    def _measure_all(self, plan: Plan, measure: Callable[[], None]) -> None:
        """Measure; after each pause of the operator, what is missing then."""
        while True:
            try:
                measure()
                return
            except Paused:
                self._stay_paused()
                measure = partial(self._go_on, plan, Progress.of(self._record))

    def _stay_paused(self) -> None:
        """Stand still until the operator lets the scan go on; the lamp stays as it is."""
        switch, clock, self._phase = self._pause, self._devices.clock, "paused"
        place = f"{self._positioner.pose}; the lamp is {self._lamp.state}"
        self._add_event(OPERATOR, f"paused {switch.turned_by}: {place}")
        switch.say(f"paused at {place}")
        begun_s = clock.now_s()
        switch.wait()
        paused = f"{clock.now_s() - begun_s:.0f} s"
        self._add_event(OPERATOR, f"continued {switch.turned_by} after {paused}")
        switch.say(f"goes on after {paused}, with a drift check where the plan has one")

    def _go_on(self, plan: Plan, progress: Progress) -> None:
        """Measure what is missing after an interruption.

        The lamp is checked for drift at the first step, and wherever it is set again for a block
        of which readings are kept: one of them was damaged in the record.
        """
        if not progress.missing(plan):
            plan.more()  # the scan ended between two batches
        kept = {reading.block for reading in progress.readings}
        blocks = list(dict.fromkeys(step.block for step in progress.missing(plan)))
        for number, block in enumerate(blocks):
            if number == 0 or block in kept:
                self._continue_from(plan, progress, progress.missing_in(block, plan)[0])
            progress = Progress.of(self._record)  # a lamp that has jumped casts doubt on readings
            self._references.restore(progress.references(), progress.checks)
            self._record.allow_replacing(progress.doubtful)
            self._scan(plan, progress.missing_in(block, plan))
            progress = Progress.of(self._record)
        self._measure_further(plan)

    def _measure(self, plan: Plan) -> None:
        """Measure all steps from the first on."""
        self._scan(plan, plan.known)
        self._measure_further(plan)

    def _measure_further(self, plan: Plan) -> None:
        """Measure what is chosen while the scan runs; each batch is on disk before the next."""
        while batch := plan.more():
            self._scan(plan, batch)

    def _continue_from(self, plan: Plan, progress: Progress, first: Step) -> None:
        """Check the lamp for drift, and return to the last accepted pose."""
        self._check_drift(plan, progress, first)
        last = progress.last_step(plan, first.block)
        if last is not None:
            self._return_to(last, first.surface)
        self._exposer.start_clock(progress.elapsed_s)

    def _check_drift(self, plan: Plan, progress: Progress, first: Step) -> None:
        """Repeat the last drift check, if the block of the next step has one."""
        original = progress.drift_step(plan, first.block)
        if original is None:
            return
        # An index of its own, so that a simulated scene draws new noise.
        step = replace(original, index=len(plan.steps) + len(progress.checks), preview=False)
        self._place(step.surface)
        self._positioner.move_to(step.pose)
        self._begin_step(step.index, progress.elapsed_s)
        elapsed_s = progress.elapsed_s
        for attempt in range(ATTEMPTS):
            reading = self._reduction.reading(self._expose(step))
            reading = replace(reading, step=original.index, time_s=elapsed_s, free_s=elapsed_s)
            check = progress.check_drift(reading, first)
            if not failed(check):
                break
            if attempt + 1 < ATTEMPTS:
                log.warning("drift check: %s: measured again", check_text(check))
        if not is_usable(reading):
            raise Interlock(f"drift check: {check_text(check)}; {what_to_look_at(reading)}")
        self._record.add_check(check)
        self._add_event(DRIFT, check_text(check))

    def _return_to(self, last: Step, next_surface: Surface) -> None:
        """Return to the last accepted pose: the next move then has an unbroken scan's backlash."""
        if last.surface == next_surface:
            self._place(next_surface)
        try:
            self._positioner.move_to(last.pose)
        except NoPathError:
            return  # no path back, but there may be one from here to the next step

    def _measure_steps(self, plan: Plan, steps: Sequence[Step]) -> None:
        for group in in_turns(steps):
            if group[0].flight is None:
                self._step_through(plan, group)
            else:
                self._place(group[0].surface)
                self._flights.fly(group)

    def _announce(self, step: Step) -> None:
        self._step, self._phase = step, "moving"
        self._begin_step(step.index, self._exposer.scan_s())

    def _accept_flown(self, exposed: Exposed, reading: Reading) -> None:
        self._on_frames(exposed, self._reduction.window(exposed.step.pose))
        self._begin_commit(exposed, reading)
        self._finish_accepting(exposed)

    def _step_through(self, plan: Plan, steps: Sequence[Step]) -> None:
        waiting = None
        for step in steps:
            if self._pause.is_on:
                self._accept(waiting)
                raise Paused
            self._announce(step)
            if step.surface != self._positioner.surface:
                self._accept(waiting)  # the operator may take their time, or give up
                waiting = None
                self._place(step.surface)
            moves = plan.moves_to(step, self._positioner.pose, self._rig)
            self._positioner.start_moves(moves, step.pose)
            self._begin_accepting(waiting)
            self._positioner.finish_moves()
            self._finish_accepting(waiting)
            waiting = self._expose(step)
            if step.kind != "point":
                self._accept_reference(waiting)
                waiting = None
        self._accept(waiting)

    def _scan(self, plan: Plan, steps: Sequence[Step]) -> None:
        """Measure these steps; an interlock casts doubt on what followed the last drift check."""
        try:
            self._measure_steps(plan, steps)
        except (Interlock, WrongRigFile):
            block = plan.steps[self._begun_step[0]].block
            check = self._references.stopped_check(block, self._exposer.scan_s())
            if check is not None:
                self._record.add_check(check)
            raise

    def _begin_step(self, index: int, scan_s: float) -> None:
        self._begun_step = (index, scan_s, self._exposer.running_s())
        self._devices.begin_step(index, scan_s)

    def _continue_step(self) -> None:
        """Tell a simulated scene that a pause is no scan time: a wait, a check of an exposure."""
        index, scan_s, begun_s = self._begun_step
        self._devices.begin_step(index, scan_s + self._exposer.running_s() - begun_s)

    def _place(self, surface: Surface) -> None:
        name = self._protocol.sample.name if surface == "sample" else "the white tile"
        self._positioner.place(surface, name)

    def _expose(self, step: Step) -> Exposed:
        """Take the frames of a step; raise `DeviceError` if an axis has moved meanwhile."""
        window, self._phase = self._reduction.window(step.pose), "exposing"
        exposed = self._exposer.expose(step, window)
        self._on_frames(exposed, window)
        self._positioner.require_in_place()
        return exposed

    def _accept_reference(self, exposed: Exposed) -> None:
        """Accept a tile reading or drift check, if need be a second one; else raise `Interlock`.

        The rig stands: no point follows a reference that proves nothing.
        """
        reading = self._reduction.reading(exposed)
        doubt = self._references.doubt(reading)
        if doubt:
            log.warning("%s: measured again", doubt)
            exposed = self._expose(exposed.step)
            reading = self._reduction.reading(exposed)
            doubt = self._references.doubt(reading)
        if doubt:
            for check in self._references.failed_checks(reading):
                self._record.add_check(check)
            raise Interlock(f"{doubt}; {what_to_look_at(reading)}")
        self._references.accept(reading)
        self._begin_commit(exposed, reading)
        self._finish_accepting(exposed)

    def _accept(self, exposed: Exposed | None) -> None:
        """Reduce the frames of a point and commit them to the record."""
        self._begin_accepting(exposed)
        self._finish_accepting(exposed)

    def _begin_accepting(self, exposed: Exposed | None) -> None:
        """Reduce the frames of a point, whose commit goes on while a move is watched from here."""
        if exposed is not None:
            self._begin_commit(exposed, self._reduction.reading(exposed))

    def _finish_accepting(self, exposed: Exposed | None) -> None:
        """Wait until the disk has what was begun."""
        if exposed is not None:
            self._record.writing.wait()
            self._on_step(exposed.step)

    def _begin_commit(self, exposed: Exposed, reading: Reading) -> None:
        step, record, preview = exposed.step, self._record, None
        if step.preview:
            window = self._reduction.window_of(exposed)
            preview = make_preview(exposed, window, self._rig.camera.max_dn)

        def write() -> None:
            taken = exposed.frames, exposed.dark
            files = write_kept(reading, *taken, self._protocol, self._rig, record.folder)
            record.add_reading(reading, preview, exposed.frames, files)

        record.writing.begin(write)
        self._exposer.note_brightness(reading)

    def _add_event(self, kind: str, text: str) -> None:
        self._record.add_event(self._devices.clock.utc().isoformat(), kind, text)
