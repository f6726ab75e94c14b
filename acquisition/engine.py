"""The engine: move, settle, expose; while the stage moves on, reduce and write down.

Knows devices only by their interfaces. Every reading is on disk before the next move counts as
done. Whatever ends a scan, the motion is stopped and the lamp darkened.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

from acquisition.axis import Axis
from acquisition.exposing import Exposed, Exposer
from acquisition.motion import Move, home_pose, moves_between
from acquisition.plan import Plan, Step
from acquisition.preview import preview_of
from acquisition.radiometry import Signal, measure
from acquisition.window import Window, window_at
from instrument.clock import Clock
from instrument.devices import Camera, Lamp, Operator, Request, Surface
from instrument.errors import DeviceError
from instrument.pinhole import Pinhole
from instrument.protocol_config import Protocol
from instrument.record import Reading, Record
from instrument.rig_config import Rig

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Devices:
    """What the engine drives. `begin_step` tells a simulated scene which step comes next.

    `close` lets go of them all.
    """

    axes: dict[str, Axis]
    camera: Camera
    lamp: Lamp
    operator: Operator
    clock: Clock
    begin_step: Callable[[int], None]
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
        self._surface: Surface | None = None
        self._exposer = Exposer(devices.camera, devices.lamp, devices.clock, protocol, rig, record)

    def run(self, plan: Plan, done: frozenset[int] = frozenset(), elapsed_s: float = 0.0) -> None:
        """Run all steps but those `done` in the `elapsed_s` that the scan has taken already.

        Leaves a safe rig behind, whatever happens.
        """
        try:
            self._prepare(plan, elapsed_s)
            self._scan([step for step in plan.steps if step.index not in done])
        finally:
            self._make_safe()

    def _prepare(self, plan: Plan, elapsed_s: float) -> None:
        """Write down who answers, home, take the darks that need a hand."""
        self._introduce("camera", self._devices.camera.identity())
        self._introduce("lamp", self._devices.lamp.identity())
        for name, axis in self._devices.axes.items():
            self._introduce(name, axis.identity())
        for axis in self._devices.axes.values():
            axis.home()
        self._exposer.begin(plan.darks_first_s, elapsed_s)

    def _introduce(self, role: str, identity: str) -> None:
        """Write down who answers; on going on with a scan it must be who answered before."""
        before = self._record.devices().get(role)
        if before not in (None, identity):
            raise DeviceError(
                f"{role}: {identity!r} answers, but the scan began with {before!r}: connect that "
                "one again, or start a new run. Nothing has moved"
            )
        self._record.add_device(role, identity)

    def _scan(self, steps: Sequence[Step]) -> None:
        pose, waiting = home_pose(self._rig), None
        for step in steps:
            self._devices.begin_step(step.index)
            if step.surface != self._surface:
                self._accept(waiting)  # the operator may take their time, or give up
                waiting = None
                self._place(step.surface)
            moves = moves_between(pose, step.pose, self._rig)
            started = self._start_first(moves)
            self._accept(waiting)
            self._finish(moves, started)
            waiting = self._exposer.expose(step, self._window(step))
            pose = step.pose
        self._accept(waiting)

    def _start_first(self, moves: Sequence[Move]) -> bool:
        """Set the first motor going, so that reduction runs while it moves."""
        if not moves or self._devices.axes[moves[0].axis].by_hand:
            return False
        self._devices.axes[moves[0].axis].start_move(moves[0].angle_deg)
        return True

    def _finish(self, moves: Sequence[Move], started: bool) -> None:
        """Make the moves one after the other, then let the axes come to rest."""
        for number, move in enumerate(moves):
            axis = self._devices.axes[move.axis]
            if number > 0 or not started:
                axis.start_move(move.angle_deg)
            axis.finish_move()
            if axis.by_hand:
                said = axis.position_deg()
                self._event("operator", f"{move.axis} set to {said:g} deg")
        for name in dict.fromkeys(move.axis for move in moves):
            self._devices.axes[name].settle()

    def _place(self, surface: Surface) -> None:
        """Have the operator put sample or white tile on the table."""
        name = self._protocol.sample.name if surface == "sample" else "the white tile"
        request = Request("place", f"Put {name} on the sample table", surface=surface)
        answer = self._devices.operator.ask(request)
        self._event("operator", f"{request.text}: {answer}")
        self._surface = surface

    def _window(self, step: Step) -> Window:
        patch = self._protocol.window
        return window_at(step.pose.theta_r, self._pinhole, patch.width_mm, patch.height_mm)

    def _accept(self, exposed: Exposed | None) -> None:
        """Reduce the frames of a step and commit them."""
        if exposed is None:
            return
        step, window = exposed.step, self._window(exposed.step)
        signal = measure(
            exposed.frames,
            exposed.dark,
            window,
            self._rig.camera,
            self._rig.u_placement_mm,
            self._protocol.window.min_pixels,
        )
        preview = preview_of(exposed, window, self._rig.camera.max_dn) if step.preview else None
        self._record.add_reading(_reading(exposed, window, signal), preview, exposed.frames)
        self._on_step(step)

    def _make_safe(self) -> None:
        """Stop every axis and shut the lamp off, even when one of them fails to answer."""
        safe: list[tuple[str, Callable[[], None]]] = [
            (name, axis.stop) for name, axis in self._devices.axes.items()
        ]
        if self._rig.lamp.darkened_by == "shutter":
            safe.append(("lamp", self._devices.lamp.darken))
        for name, action in safe:
            try:
                action()
            except (DeviceError, OSError) as error:
                log.error("%s could not be made safe: %s", name, error)

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
        time_utc=exposed.time_utc,
        **asdict(signal),
    )
