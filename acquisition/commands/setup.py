"""Commands for setting up a rig: `gonio devices`, `home` and `move`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from acquisition.engine.axis import Axis
from acquisition.plan.moves import axis_moves
from acquisition.rig import OpenRig, restart_for_emulated_camera
from acquisition.terminal.console import console, out
from acquisition.terminal.operator import require_yes
from acquisition.terminal.orderly_end import orderly_end
from acquisition.terminal.stop_signals import reason
from acquisition.terminal.stop_thread import stopped_by_signals
from instrument.config.axes import AXES, HandAxis, MotorAxis
from instrument.config.load import load_rig
from instrument.config.rig import Rig
from instrument.errors import DeviceError, InputError, OperatorStop

_ENDED = ": all motion has ended"


def home_axis(axis: str, rig_path: Path | None, yes: bool) -> None:
    """Home one axis. `yes`: the rig may move, without asking the operator."""
    rig = require_rig(rig_path)
    _motor(axis, rig)
    with orderly_end(), OpenRig(rig) as open_rig:
        stage = open_rig.axis(axis)
        confirm(rig, yes, f"{stage.identity()}\n{axis}{_at(stage)} will look for its reference.")
        with stopped_at_an_error(stage):
            stage.home()
        _print_position(axis, stage.position_deg())


def move_axis(axis: str, angle_deg: float, rig_path: Path | None, yes: bool) -> None:
    """Move one axis to `angle_deg` of the rig. `yes`: the rig may move, without asking."""
    rig = require_rig(rig_path)
    settings = _motor(axis, rig)
    if not settings.min_deg <= angle_deg <= settings.max_deg:
        raise InputError(
            f"gonio move: {axis} {angle_deg:g} deg; allowed by {rig_path}: "
            f"{settings.min_deg:g} to {settings.max_deg:g} deg. Nothing has moved."
        )
    with orderly_end(), OpenRig(rig) as open_rig:
        stage = open_rig.axis(axis)
        if not rig.real:
            stage.home()  # a simulated stage starts unhomed with every command
        here_deg = stage.position_deg()
        question = f"{stage.identity()}\n{axis} will move from {here_deg:.4f} to {angle_deg:g} deg."
        if rig.keep_out:
            question += " The other axes are not read: keep-out zones are NOT checked."
        confirm(rig, yes, question)
        with stopped_at_an_error(stage):
            for move in axis_moves(axis, here_deg, angle_deg, rig):
                stage.start_move(move.angle_deg)
                stage.finish_move()
        _print_position(axis, stage.position_deg())


def _at(axis: Axis) -> str:
    """Return the angle at which an axis is found, empty if its reference is not known."""
    try:
        return f", found at {axis.position_deg():.4f} deg,"
    except DeviceError:  # it is named where the motion is refused
        return ""


@contextmanager
def stopped_at_an_error(*axes: Axis) -> Iterator[None]:
    """Stop axes at a signal, at once, and at any error of a `with` block in which they move."""
    with stopped_by_signals({axis.name: axis.stop for axis in axes}):
        try:
            with orderly_end():
                yield
        except BaseException as error:
            trouble = "".join(map(_trouble_of_stop, axes))
            if isinstance(error, KeyboardInterrupt):
                why = str(error) or "stopped by the operator"
                raise OperatorStop(f"{why}{trouble or _ENDED}") from None
            if isinstance(error, DeviceError) and reason():  # a signal came as well
                raise OperatorStop(f"{reason()}{trouble or _ENDED}\n{error}") from error
            if isinstance(error, DeviceError) and trouble:
                raise type(error)(f"{error}{trouble}") from error
            raise


def _trouble_of_stop(axis: Axis) -> str:
    """Stop an axis; return the line to be added to the reason if that failed, else nothing.

    A signal that comes meanwhile does not keep it from being known whether the axis stands.
    """
    try:
        try:
            axis.stop()
        except KeyboardInterrupt:
            axis.stop()
    except (DeviceError, OSError) as error:
        return f"\nLOOK AT THE RIG FIRST: {axis.name} could not be stopped: {error}"
    return ""


def _print_position(axis: str, angle_deg: float) -> None:
    out.print(f"{axis}: stands at {angle_deg:.4f} deg", highlight=False)


def list_devices(rig_path: Path | None, identify: bool) -> None:
    """Print the computer's serial ports and cameras; with a rig, open and identify its devices.

    `identify`: query every serial port for known controllers.
    """
    from drivers.discovery import cameras, serial_ports

    ports = serial_ports(identify)
    out.print("serial ports" if ports else "serial ports: none", highlight=False)
    for port in ports:
        out.print(f"  {port}", highlight=False, soft_wrap=True)
    found = cameras()
    out.print("cameras" if found else "cameras: none", highlight=False)
    for camera in found:
        out.print(camera, highlight=False, soft_wrap=True)
    if rig_path is not None:
        _identify_devices(rig_path)


def _identify_devices(rig_path: Path) -> None:
    rig = load_rig(rig_path)
    restart_for_emulated_camera(rig)
    out.print(f"rig {rig.name} ({rig_path})", highlight=False)
    failed = 0
    with orderly_end(), OpenRig(rig) as open_rig:
        for name in (*AXES, "camera"):
            try:
                device = open_rig.camera() if name == "camera" else open_rig.axis(name)
                text = device.identity()
            except DeviceError as error:
                text, failed = f"FAILED: {error}", failed + 1
            out.print(f"  {name}: {text}", highlight=False, soft_wrap=True)
    if failed:
        raise DeviceError(f"{failed} of the devices of {rig_path} cannot be used: see above")


def _motor(axis: str, rig: Rig) -> MotorAxis:
    """Settings of a motorised axis; raises `InputError` for any other."""
    if axis not in AXES:
        raise InputError(f"{axis!r} is no axis; allowed: {', '.join(AXES)}")
    settings = rig.axes[axis]
    if isinstance(settings, HandAxis):
        raise InputError(f"{axis} is set by hand on the rig {rig.name}: it has no motor to move")
    return settings


def require_rig(path: Path | None, *, calibrated: bool = False) -> Rig:
    """Return the rig of a file; raise `InputError` if none is named or it is wrong.

    `calibrated`: with the calibration of its camera, if it names one.
    """
    if path is None:
        raise InputError("name the rig file: --rig FILE")
    return load_rig(path, calibrated=calibrated)


def confirm(rig: Rig, yes: bool, question: str) -> None:
    """Say what will move on a real rig, and ask, unless `yes`."""
    if rig.real and yes:
        console.print(question, highlight=False, soft_wrap=True)
    elif rig.real:
        require_yes(
            f"{question} Is the rig clear?",
            f"{question}\nnobody to ask whether the rig is clear: add --yes",
            "nothing has moved",
        )
