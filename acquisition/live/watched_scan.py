"""State of a scan as the live page shows it, and what its buttons do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from acquisition.engine.axis import Axis
from acquisition.engine.exposure.exposer import Exposed
from acquisition.engine.onlookers import MEASURING, Present
from acquisition.engine.pause import PauseSwitch
from acquisition.live.channel import ABORT, OK, PAUSE, RESUME
from acquisition.live.publisher import Seen, State
from acquisition.measure.window import Window
from acquisition.plan.plan import Step

_BY = "on the live page"
_PHASES = {  # of the engine, in the page's words
    "homing": "finding references, taking darks",
    "moving": "moving",
    "exposing": "taking frames",
    "pausing": "pauses after this geometry",
    "paused": "paused",
    "operator": "waiting for the operator",
    "ending": "the rig is made safe",
}
_KINDS = {"point": "sample", "tile": "white tile", "drift": "drift check"}


def state_of(present_state: Callable[[], Present], axes: Mapping[str, Axis]) -> State:
    """Return the state of scan and rig for the page; angles in degrees, None where unknown."""
    present = present_state()
    return {
        "phase": "measuring" if present.phase in MEASURING else present.phase,
        "text": present.asked or _PHASES[present.phase],
        "step": None if present.step is None else present.step.index,
        "axes": {name: _axis(name, axis, present) for name, axis in axes.items()},
        "lamp": present.lamp,
    }


def seen_of(exposed: Exposed, window: Window) -> Seen:
    """Return the last frame of a step, as it is shown."""
    step = exposed.step
    about = {"step": step.index, "caption": caption(step)}
    return Seen(exposed.frames[-1], window, about)


def caption(step: Step) -> str:
    """Return what a frame of this step shows: the surface and the angles in degrees."""
    pose = step.pose
    return f"{_KINDS[step.kind]}: θᵢ {pose.theta_i:g}°, Δφ {pose.dphi:g}°, θᵣ {pose.theta_r:g}°"


def buttons(
    switch: PauseSwitch, present: Callable[[], Present], abort: Callable[[str], None]
) -> Callable[[str], str]:
    """Return the function that carries out a command of the page and returns the answer.

    abort: ends the scan as a signal does; it is given the reason for the record.
    """

    def follow(command: str) -> str:
        if present().phase == "ending":
            return "the scan is ending"
        if command == ABORT:
            abort(f"stopped by the operator {_BY}")
        elif command in (PAUSE, RESUME):
            switch.turn(on=command == PAUSE, by=_BY)
        return OK

    return follow


def _axis(name: str, axis: Axis, present: Present) -> dict[str, object]:
    """Return where an axis stands; while it moves, where it is going."""
    moving = present.moving == name
    angle_deg = getattr(present.target if moving else present.pose, name)
    known = None if math.isnan(angle_deg) else angle_deg
    return {"deg": known, "by_hand": axis.by_hand, "moving": moving}
