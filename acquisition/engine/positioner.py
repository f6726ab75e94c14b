"""Positioning: moves the axes along a checked path, and has the operator swap the surface."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

from acquisition.engine.axis import Axis
from acquisition.plan.moves import Move, moves_between
from acquisition.plan.pose import Pose, home_pose
from instrument.config.axes import AXES
from instrument.config.rig import Rig
from instrument.devices import Lamp, Operator, Request, Surface
from instrument.errors import ComputerPaused, DeviceError

log = logging.getLogger(__name__)

PAUSES_A_SCAN = 3  # of the computer, after which a scan goes on, each in another move


class Positioner:
    """Keeps track of pose and surface, and is the only one to change them.

    `note` records the operator's answers.
    """

    def __init__(
        self,
        rig: Rig,
        axes: Mapping[str, Axis],
        lamp: Lamp,
        operator: Operator,
        note: Callable[[str], None],
    ) -> None:
        self._rig, self._axes, self._lamp = rig, axes, lamp
        self._operator, self._note = operator, note
        self.pose = home_pose(rig)
        self.surface: Surface | None = None
        self._moves: tuple[Move, ...] = ()
        self.target = self.pose
        self._started = False
        self.moving = ""  # name of the axis that was told to move last and has not arrived
        self._asked = ""  # of the operator
        self._pauses, self._paused_move = 0, False

    def home(self) -> None:
        """Home every axis."""
        for axis in self._axes.values():
            axis.home()

    def recover_position(self) -> dict[str, float]:
        """Determine the pose after an interruption: stop all axes, home those that need it.

        Returns the angles in degrees at which the others were found.
        """
        for axis in self._axes.values():
            axis.begin_stop()
        for axis in self._axes.values():
            axis.finish_stop()
        motors = {name: axis for name, axis in self._axes.items() if not axis.by_hand}
        found = {}
        for name, axis in motors.items():
            if axis.homed():
                found[name] = axis.position_deg()
                axis.restore_speed()  # a turn may have been killed
            else:
                axis.home()
        # nan for an axis set by hand
        self.pose = self.target = Pose(**{**home_pose(self._rig)._asdict(), **found})
        return found

    def move_to(self, pose: Pose) -> None:
        """Move to a pose and come to rest; raise `NoPathError`, before moving, without a path."""
        self.start_moves(moves_between(self.pose, pose, self._rig), pose)
        self.finish_moves()

    def start_moves(self, moves: tuple[Move, ...], target: Pose) -> None:
        """Start the first of the moves to a pose, if it is a motor's, and return."""
        self._moves, self.target = moves, target
        self._started = bool(moves) and not self._axes[moves[0].axis].by_hand
        if self._started:
            self._start(moves[0])

    def finish_moves(self) -> None:
        """Make the moves one after the other, then let the axes settle."""
        for number, move in enumerate(self._moves):
            axis = self._axes[move.axis]
            if number > 0 or not self._started:
                self._start(move)
            self._finish(move)
            if axis.by_hand:
                self._note(f"{move.axis} set to {axis.position_deg():g} deg")
        for name in dict.fromkeys(move.axis for move in self._moves):
            self._axes[name].settle()
        self.pose, self._moves = self.target, ()

    def start_turn(self, name: str, end: Pose, speed_deg_per_s: float) -> None:
        """Start a steady turn of a motor to a pose along a way that was checked, and return."""
        axis = self._axes[name]
        axis.set_speed(speed_deg_per_s)
        self._moves, self.target = (), end
        self._start(Move(name, getattr(end, name), 0.0))

    def finish_turn(self, name: str) -> None:
        """Wait for the end of a turn; later moves have the rig file's speed again."""
        axis = self._axes[name]
        axis.finish_move()
        self.moving, self.pose = "", self.target
        axis.restore_speed()

    def break_off(self, name: str) -> None:
        """Stop a turn where it is; at rest, do nothing."""
        if self.moving == name:
            self._axes[name].stop()
            self._stand(name)

    def stand_after(self, name: str, pause: ComputerPaused) -> None:
        """Go on from where an axis stands after a pause of the computer, within bounds."""
        axis = self._axes[name]
        self._require_may_go_on(axis, pause)
        self._stand(name)

    def _stand(self, name: str) -> None:
        axis = self._axes[name]
        axis.restore_speed()
        self.moving = ""
        self.pose = self.target = self.pose._replace(**{name: axis.position_deg()})

    def _start(self, move: Move) -> None:
        axis = self._axes[move.axis]
        self.moving, self._paused_move = move.axis, False
        self._despite_pause(axis, lambda: axis.start_move(move.angle_deg))

    def _finish(self, move: Move) -> None:
        axis = self._axes[move.axis]

        def whole_move() -> None:
            axis.start_move(move.angle_deg)
            axis.finish_move()

        self._despite_pause(axis, axis.finish_move, whole_move)
        self.moving = ""

    def _despite_pause(
        self, axis: Axis, action: Callable[[], None], again: Callable[[], None] | None = None
    ) -> None:
        """Act; after a pause of the computer, within bounds, act `again`, or as before."""
        try:
            action()
        except ComputerPaused as pause:
            self._require_may_go_on(axis, pause)
            self._despite_pause(axis, again or action)

    def _require_may_go_on(self, axis: Axis, pause: ComputerPaused) -> None:
        """Raise the pause again unless the axis stands, has its reference, and bounds allow it."""
        self._pauses += 1
        if self._paused_move or self._pauses > PAUSES_A_SCAN:
            often = (
                "again in this move" if self._paused_move else f"{self._pauses} times in this scan"
            )
            raise ComputerPaused(f"{pause}; {often}, which is too often to go on") from pause
        self._paused_move = True
        if not axis.homed():  # read at rest
            raise ComputerPaused(f"{pause}; {axis.name} has lost its reference") from pause
        log.warning("%s; goes on from %g deg, where it stands", pause, axis.position_deg())

    def require_in_place(self) -> None:
        """Raise `DeviceError` if a motor has left the pose: frames taken since are invalid."""
        for name, axis in self._axes.items():
            if not axis.by_hand:
                axis.require_at(getattr(self.pose, name))

    def place(self, surface: Surface, name: str) -> None:
        """Have the operator put sample or white tile on the table, unless it is there."""
        if surface == self.surface:
            return
        request = Request("place", f"Put {name} on the sample table", surface=surface)
        self._asked = request.text
        answer = self._operator.ask(request)
        self._asked = ""
        self._note(f"{request.text}: {answer}")
        self.surface = surface

    def open_shutter(self) -> None:
        """Let the lamp's light onto the sample, if it has a shutter."""
        if self._rig.lamp.darkened_by == "shutter":
            self._lamp.light()

    @property
    def asked(self) -> str:
        """Request to the operator that is not done yet, empty if there is none."""
        moving = self.moving
        if moving and self._axes[moving].by_hand:
            return f"Set {moving} to {getattr(self.target, moving):g} deg by hand"
        return self._asked

    def make_safe(self) -> None:
        """Stop every axis and close the shutter, even if some of them fail.

        All stops are sent, that of what moves first, before it is waited until the axes were read
        to stand. An action interrupted by a Ctrl-C is repeated, however often, and this is logged.
        """
        names = sorted(AXES, key=lambda name: name != self.moving)
        axes = [(name, self._axes[name]) for name in names if name in self._axes]
        actions: list[tuple[str, Callable[[], None]]] = [
            *((name, axis.begin_stop) for name, axis in axes),
            *((name, axis.finish_stop) for name, axis in axes),
        ]
        if self._rig.lamp.darkened_by == "shutter":
            actions.append(("lamp", self._lamp.darken))
        for name, action in actions:
            _insist(name, action)


def _insist(name: str, action: Callable[[], None]) -> None:
    """Carry out an action, and again after each Ctrl-C: the stop may not have been sent."""
    interrupted = False
    while True:
        try:
            if interrupted:
                log.error("%s: Ctrl-C while the rig was made safe: action repeated", name)
            _attempt(name, action)
            return
        except KeyboardInterrupt:
            interrupted = True


def _attempt(name: str, action: Callable[[], None]) -> None:
    try:
        action()
    except (DeviceError, OSError) as error:
        log.error("%s could not be made safe: %s", name, error)
