"""The engine: move, settle, expose; while the stage moves on, reduce and write down.

Knows devices only by their interfaces. Every reading is on disk before the next move counts as
done. Whatever ends a scan, the motion is stopped and the lamp darkened, and nothing moves again in
this process: to go on is the operator's word.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace

from acquisition.engine.axis import Axis
from acquisition.engine.exposer import Exposed, Exposer
from acquisition.engine.frame_files import keep
from acquisition.engine.positioner import Positioner
from acquisition.engine.preview import preview_of
from acquisition.engine.resume import Progress, describe
from acquisition.engine.retrying_camera import RetryingCamera
from acquisition.measure.radiometry import Signal, measure
from acquisition.measure.window import Window, window_at
from acquisition.plan.moves import NoPathError
from acquisition.plan.plan import Plan, Step
from instrument.clock import Clock
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Camera, Lamp, Operator, Surface
from instrument.errors import DeviceError
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading
from instrument.record.record import Record


@dataclass(frozen=True, slots=True)
class Devices:
    """What the engine drives.

    `begin_step` tells a simulated scene which step comes next, and at which time of the plan it is
    read. `close` lets go of them all.
    """

    axes: dict[str, Axis]
    camera: Camera
    lamp: Lamp
    operator: Operator
    clock: Clock
    begin_step: Callable[[int, float], None]
    close: Callable[[], None] = lambda: None


class Engine:
    """Runs the steps of a plan; `on_step` is told of each step once it is on disk."""

    def __init__(
        self,
        protocol: Protocol,
        rig: Rig,
        devices: Devices,
        record: Record,
        on_step: Callable[[Step], None],
    ) -> None:
        self._protocol, self._rig, self._devices = protocol, rig, devices
        self._record, self._on_step = record, on_step
        self._pinhole = Pinhole.of(rig)
        self._ended = False
        self._hands = Positioner(rig, devices.axes, devices.lamp, devices.operator, self._answered)
        camera = RetryingCamera(devices.camera)
        self._exposer = Exposer(camera, devices.lamp, devices.clock, protocol, rig, record)

    def run(self, plan: Plan, so_far: Progress | None = None) -> None:
        """Run all steps, or those that are missing `so_far` of a scan that was stopped.

        Leaves a safe rig behind, whatever happens, and refuses (`DeviceError`) to run again.
        """
        if self._ended:
            raise DeviceError(
                "the scan has ended and the rig was made safe: nothing moves again before the "
                "operator has said so: gonio resume"
            )
        try:
            self._introduce_all()
            if so_far is None:
                self._begin(plan)
                self._scan(plan.steps)
            else:
                self._go_on(plan, so_far)
                self._scan(so_far.missing(plan))
        finally:
            self._ended = True
            self._hands.make_safe()

    def _introduce_all(self) -> None:
        devices = self._devices
        named: dict[str, Camera | Axis] = {"camera": devices.camera, **devices.axes}
        for role, device in named.items():
            self._introduce(role, device.identity())
            self._record.add_settings(devices.clock.utc().isoformat(), role, device.settings())
        self._introduce("lamp", devices.lamp.identity())

    def _introduce(self, role: str, identity: str) -> None:
        """Write down who answers; on going on with a scan it must be who answered before."""
        before = self._record.devices().get(role)
        if before not in (None, identity):
            raise DeviceError(
                f"{role}: {identity!r} answers, but the scan began with {before!r}: connect that "
                "one again, or start a new run. Nothing has moved"
            )
        self._record.add_device(role, identity)

    def _begin(self, plan: Plan) -> None:
        """Home, take the darks that need a hand."""
        self._hands.home()
        self._open_shutter()
        self._exposer.start(0.0)
        self._exposer.take_darks(plan.darks_first_s)

    def _go_on(self, plan: Plan, so_far: Progress) -> None:
        """Bring the rig where the scan stood, look whether the lamp is what it was."""
        first = so_far.missing(plan)[0]
        self._hands.find()
        self._open_shutter()
        self._exposer.know(so_far.readings)
        self._exposer.take_darks(plan.darks_first_s)
        self._check_drift(plan, so_far, first)
        stood = so_far.where_it_stood(plan, first)
        if stood is not None:
            self._return_to(stood, first.surface)
        self._exposer.start(so_far.elapsed_s)

    def _open_shutter(self) -> None:
        """However the lamp was left."""
        if self._rig.lamp.darkened_by == "shutter":
            self._devices.lamp.light()

    def _check_drift(self, plan: Plan, so_far: Progress, first: Step) -> None:
        """Measure the drift reference again, if the scan has one to compare with."""
        repeated = so_far.drift_step(plan, first.block)
        if repeated is None:
            return
        # A number of its own, so that a simulated scene gives it noise of its own.
        own = replace(repeated, index=len(plan.steps) + len(so_far.checks), preview=False)
        self._devices.begin_step(own.index, first.start_s)
        self._place(own.surface)
        self._hands.go(own.pose)
        reading = replace(
            self._reduced(self._exposed(own)),
            step=repeated.index, time_s=so_far.elapsed_s, free_s=so_far.elapsed_s,
        )  # fmt: skip
        check = so_far.check(reading, first)
        self._record.add_check(check)
        self._event("drift", describe(check))

    def _return_to(self, stood: Step, next_surface: Surface) -> None:
        """Stand as after the last accepted step: then the next is come to as it would have been."""
        if stood.surface == next_surface:
            self._place(next_surface)
        try:
            self._hands.go(stood.pose)
        except NoPathError:
            return  # no straight way back; there is one to the next step, from here

    def _scan(self, steps: Sequence[Step]) -> None:
        waiting = None
        for step in steps:
            self._devices.begin_step(step.index, step.start_s + step.duration_s)
            if step.surface != self._hands.surface:
                self._accept(waiting)  # the operator may take their time, or give up
                waiting = None
                self._place(step.surface)
            self._hands.set_out(step.pose)
            self._accept(waiting)
            self._hands.arrive()
            waiting = self._exposed(step)
        self._accept(waiting)

    def _place(self, surface: Surface) -> None:
        name = self._protocol.sample.name if surface == "sample" else "the white tile"
        self._hands.place(surface, name)

    def _exposed(self, step: Step) -> Exposed:
        """The frames of a step, for all of which the axes stood where they were put."""
        exposed = self._exposer.expose(step, self._window(step))
        self._hands.require_in_place()
        return exposed

    def _window(self, step: Step) -> Window:
        patch = self._protocol.window
        return window_at(step.pose.theta_r, self._pinhole, patch.width_mm, patch.height_mm)

    def _accept(self, exposed: Exposed | None) -> None:
        """Reduce the frames of a step and commit them."""
        if exposed is None:
            return
        step, reading = exposed.step, self._reduced(exposed)
        preview = None
        if step.preview:
            preview = preview_of(exposed, self._window(step), self._rig.camera.max_dn)
        kept = self._protocol.keep_frames
        files = keep(exposed.frames, step.index, self._record.folder) if kept else ()
        self._record.add_reading(reading, preview, exposed.frames, files)
        self._exposer.seen(reading)
        self._on_step(step)

    def _reduced(self, exposed: Exposed) -> Reading:
        window = self._window(exposed.step)
        signal = measure(
            exposed.frames,
            exposed.dark,
            window,
            self._rig.camera,
            self._rig.u_placement_mm,
            self._protocol.window.min_pixels,
        )
        return _reading(exposed, window, signal)

    def _answered(self, text: str) -> None:
        self._event("operator", text)

    def _event(self, kind: str, text: str) -> None:
        self._record.add_event(self._devices.clock.utc().isoformat(), kind, text)


def _reading(exposed: Exposed, window: Window, signal: Signal) -> Reading:
    """The row of the record."""
    step, first = exposed.step, exposed.frames[0]
    return Reading(
        step=step.index,
        kind=step.kind,
        surface=step.surface,
        theta_i_deg=step.pose.theta_i,
        dphi_deg=step.pose.dphi,
        theta_r_deg=step.pose.theta_r,
        lamp_setting=step.lamp_setting,
        block=step.block,
        exposure_s=first.exposure_s,
        frames=len(exposed.frames),
        window_pixels=window.pixels,
        time_s=exposed.time_s,
        free_s=exposed.free_s,
        time_utc=exposed.time_utc,
        **asdict(signal),
    )
