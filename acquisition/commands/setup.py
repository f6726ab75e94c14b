"""Commands for setting up a rig: `gonio devices`, `home`, `move` and `grab`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from acquisition.measure.window import Window, window_at
from acquisition.plan.moves import axis_moves
from acquisition.results.model_check import check_model
from acquisition.rig import OpenRig, restart_for_emulated_camera
from acquisition.terminal.console import out
from acquisition.terminal.operator import require_yes
from instrument.config.axes import AXES, HandAxis, MotorAxis
from instrument.config.load import load_protocol, load_rig
from instrument.config.protocol import PatchConfig
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import DeviceError, InputError
from instrument.pinhole import Pinhole
from instrument.text.atomic_file import write_whole

# Outline that is drawn where no protocol gives its size.
DEFAULT_PATCH = PatchConfig(width_mm=20.0, height_mm=20.0)


def home_axis(axis: str, rig_path: Path | None, yes: bool) -> None:
    """Home one axis. `yes`: the rig may move, without asking the operator."""
    rig = _load_rig(rig_path)
    _motor(axis, rig)
    with OpenRig(rig) as open_rig:
        stage = open_rig.axis(axis)
        _confirm(rig, yes, f"{stage.identity()}\n{axis} will look for its reference.")
        try:
            stage.home()
        except BaseException:
            stage.stop()
            raise
        _print_position(axis, stage.position_deg())


def move_axis(axis: str, angle_deg: float, rig_path: Path | None, yes: bool) -> None:
    """Move one axis to `angle_deg` of the rig. `yes`: the rig may move, without asking."""
    rig = _load_rig(rig_path)
    settings = _motor(axis, rig)
    if not settings.min_deg <= angle_deg <= settings.max_deg:
        raise InputError(
            f"gonio move: {axis} {angle_deg:g} deg; allowed by {rig_path}: "
            f"{settings.min_deg:g} to {settings.max_deg:g} deg. Nothing has moved."
        )
    with OpenRig(rig) as open_rig:
        stage = open_rig.axis(axis)
        if not rig.real:
            stage.home()  # a simulated stage starts unhomed with every command
        here_deg = stage.position_deg()
        question = f"{stage.identity()}\n{axis} will move from {here_deg:.4f} to {angle_deg:g} deg."
        if rig.keep_out:
            question += " The other axes are not read: keep-out zones are NOT checked."
        _confirm(rig, yes, question)
        try:
            for move in axis_moves(axis, here_deg, angle_deg, rig):
                stage.start_move(move.angle_deg)
                stage.finish_move()
        except BaseException:
            stage.stop()
            raise
        _print_position(axis, stage.position_deg())


def _print_position(axis: str, angle_deg: float) -> None:
    out.print(f"{axis}: stands at {angle_deg:.4f} deg", highlight=False)


def grab_frame(
    path: Path,
    rig_path: Path | None,
    protocol_path: Path | None,
    *,
    theta_r_deg: float,
    exposure_s: float | None,
    as_json: bool,
) -> None:
    """Take one frame, write it to `path` (.png or .tiff) and print its statistics.

    Nothing moves: `theta_r_deg` is the camera's present angle, for the outline of the window.
    """
    if path.suffix.lower() not in (".png", ".tif", ".tiff"):
        raise InputError(f"{path}: --out must end in .png (8 bit, drawn on) or .tiff (raw counts)")
    rig, patch = _rig_and_patch(rig_path, protocol_path)
    low, high = rig.camera.min_exposure_s, rig.camera.max_exposure_s
    if exposure_s is not None and not low <= exposure_s <= high:
        raise InputError(f"--exposure-s: {exposure_s:g} s; the camera can do {low:g} to {high:g} s")
    restart_for_emulated_camera(rig)
    with OpenRig(rig) as open_rig:
        open_rig.pose_scene(theta_r_deg)
        camera = open_rig.camera()
        camera.set_exposure_s(low if exposure_s is None else exposure_s)
        frame, identity = camera.grab(1)[0], camera.identity()
    window = window_at(theta_r_deg, Pinhole.of(rig), patch.width_mm, patch.height_mm)
    write_whole(path, _encoded(frame, window, rig, path.suffix))
    _print_statistics(_statistics(frame, window, rig), identity, path, as_json)


def _rig_and_patch(rig_path: Path | None, protocol_path: Path | None) -> tuple[Rig, PatchConfig]:
    if protocol_path is None:
        return _load_rig(rig_path), DEFAULT_PATCH
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    return loaded.rig, loaded.protocol.window


def _statistics(frame: Frame, window: Window, rig: Rig) -> dict[str, float]:
    """Counts of the whole frame and of the window, in DN, by name."""
    inside = frame.image[window.crop][window.counted]
    if not inside.size:
        raise InputError(
            "gonio grab: the window lies outside the picture: check axis_row_px and "
            "axis_column_px of the rig file"
        )
    return {
        "exposure_s": frame.exposure_s,
        "frame_mean_dn": float(frame.image.mean()),
        "frame_max_dn": float(frame.image.max()),
        "window_mean_dn": float(inside.mean()),
        "window_std_dn": float(inside.std()),
        "window_min_dn": float(inside.min()),
        "window_max_dn": float(inside.max()),
        "window_pixels": window.pixels,
        "saturated_pixels": float(np.count_nonzero(frame.image >= rig.camera.max_dn)),
        "full_scale_dn": float(rig.camera.max_dn),
    }


def _print_statistics(
    statistics: dict[str, float], identity: str, path: Path, as_json: bool
) -> None:
    if as_json:
        sys.stdout.write(json.dumps({"camera": identity, "file": str(path), **statistics}) + "\n")
        return
    out.print(identity, highlight=False)
    for name, value in statistics.items():
        out.print(f"  {name:18} {value:.6g}", highlight=False)
    out.print(f"picture: {path}", highlight=False, soft_wrap=True)


def _encoded(frame: Frame, window: Window, rig: Rig, suffix: str) -> bytes:
    """Raw counts as TIFF, or an 8-bit PNG with the window's outline and the rotation axis."""
    import cv2

    if suffix.lower() != ".png":
        return bytes(cv2.imencode(".tiff", frame.image)[1].tobytes())
    shown = (frame.image * (255.0 / rig.camera.max_dn)).astype(np.uint8)
    drawn = cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR)
    axis = (round(rig.camera.axis_column_px), round(rig.camera.axis_row_px))
    outline = np.round(window.outline_px * 16).astype(np.int32)
    cv2.polylines(drawn, [outline], True, (0, 200, 255), 1, cv2.LINE_AA, shift=4)
    cv2.drawMarker(drawn, axis, (0, 200, 255), cv2.MARKER_CROSS, 12, 1)
    return bytes(cv2.imencode(".png", drawn)[1].tobytes())


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
    with OpenRig(rig) as open_rig:
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


def _load_rig(path: Path | None) -> Rig:
    if path is None:
        raise InputError("name the rig file: --rig FILE")
    return load_rig(path)


def _confirm(rig: Rig, yes: bool, question: str) -> None:
    """Ask before a real rig moves, unless `yes`."""
    if rig.real and not yes:
        require_yes(
            f"{question} Is the rig clear?",
            f"{question}\nnobody to ask whether the rig is clear: add --yes",
            "nothing has moved",
        )
