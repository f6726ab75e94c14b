"""The commands for setting a rig up: `gonio devices`, `home`, `move` and `grab`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from acquisition.measure.window import Window, window_at
from acquisition.plan.moves import axis_moves
from acquisition.results.model_check import check_model
from acquisition.rig import Bench, see_emulated_camera
from acquisition.terminal.console import out
from acquisition.terminal.operator import require_yes
from instrument.config.axes import AXES, HandAxis, MotorAxis
from instrument.config.load import Loaded, load_protocol, load_rig
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import DeviceError, InputError
from instrument.pinhole import Pinhole
from instrument.text.atomic_file import write_whole

WINDOW_MM = 20.0  # of the window that is drawn where no protocol says how large it is


def home_axis(axis: str, rig_path: Path | None, yes: bool) -> None:
    """Find the reference of one axis."""
    loaded = _bare(rig_path)
    _motor(axis, loaded.rig)
    with Bench(loaded) as bench:
        stage = bench.axis(axis)
        _confirm(loaded.rig, yes, f"{stage.identity()}\n{axis} will look for its reference.")
        try:
            stage.home()
        except BaseException:
            stage.stop()
            raise
        out.print(f"{axis}: stands at {stage.position_deg():.4f} deg", highlight=False)


def move_axis(axis: str, angle_deg: float, rig_path: Path | None, yes: bool) -> None:
    """Move one axis to an angle of the rig. A simulated one is homed first."""
    loaded = _bare(rig_path)
    settings = _motor(axis, loaded.rig)
    if not settings.min_deg <= angle_deg <= settings.max_deg:
        raise InputError(
            f"gonio move: {axis} {angle_deg:g} deg; allowed by {loaded.rig_path}: "
            f"{settings.min_deg:g} to {settings.max_deg:g} deg. Nothing has moved."
        )
    with Bench(loaded) as bench:
        stage = bench.axis(axis)
        if not loaded.rig.real:
            stage.home()  # what is simulated begins anew with every command
        here = stage.position_deg()
        question = f"{stage.identity()}\n{axis} will move from {here:.4f} to {angle_deg:g} deg."
        if loaded.rig.keep_out:
            question += " Where the other axes stand is not known: keep-out zones are NOT checked."
        _confirm(loaded.rig, yes, question)
        try:
            for move in axis_moves(axis, here, angle_deg, loaded.rig):
                stage.start_move(move.angle_deg)
                stage.finish_move()
        except BaseException:
            stage.stop()
            raise
        out.print(f"{axis}: stands at {stage.position_deg():.4f} deg", highlight=False)


def grab_frame(
    path: Path,
    *,
    rig_path: Path | None,
    protocol_path: Path | None,
    theta_r_deg: float,
    exposure_s: float | None,
    as_json: bool,
) -> None:
    """Take one frame, for aiming: the picture with the window drawn on it, and its statistics.

    Nothing moves: `theta_r_deg` says where the camera stands.
    """
    if path.suffix.lower() not in (".png", ".tif", ".tiff"):
        raise InputError(f"{path}: --out must end in .png (8 bit, drawn on) or .tiff (raw counts)")
    if protocol_path is None:
        loaded = _bare(rig_path)
    else:
        loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    low, high = loaded.rig.camera.min_exposure_s, loaded.rig.camera.max_exposure_s
    if exposure_s is not None and not low <= exposure_s <= high:
        raise InputError(f"--exposure-s: {exposure_s:g} s; the camera can do {low:g} to {high:g} s")
    see_emulated_camera(loaded.rig)
    with Bench(loaded) as bench:
        bench.stand_at(theta_r_deg)
        camera = bench.camera()
        camera.set_exposure_s(low if exposure_s is None else exposure_s)
        frame, identity = camera.grab(1)[0], camera.identity()
    patch = loaded.protocol.window
    window = window_at(theta_r_deg, Pinhole.of(loaded.rig), patch.width_mm, patch.height_mm)
    write_whole(path, _encoded(frame, window, loaded.rig, path.suffix))
    _print_statistics(_statistics(frame, window, loaded.rig), identity, path, as_json)


def _statistics(frame: Frame, window: Window, rig: Rig) -> dict[str, float]:
    """Counts of the whole frame and of the window, in DN."""
    inside = frame.image[window.crop][window.counted]
    if not inside.size:
        raise InputError(
            "grab: the window lies outside the picture: see axis_row_px, axis_column_px"
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


def _print_statistics(found: dict[str, float], identity: str, path: Path, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps({"camera": identity, "file": str(path), **found}) + "\n")
        return
    out.print(identity, highlight=False)
    for name, value in found.items():
        out.print(f"  {name:18} {value:.6g}", highlight=False)
    out.print(f"picture: {path}", highlight=False, soft_wrap=True)


def _encoded(frame: Frame, window: Window, rig: Rig, suffix: str) -> bytes:
    """The raw counts as TIFF, or the picture in 8 bit with the window's outline."""
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
    """Serial ports and cameras of this computer; with a rig file, who answers for each device."""
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
        _print_rig(rig_path)


def _print_rig(rig_path: Path) -> None:
    loaded = _bare(rig_path)
    see_emulated_camera(loaded.rig)
    out.print(f"rig {loaded.rig.name} ({rig_path})", highlight=False)
    failed = 0
    with Bench(loaded) as bench:
        for name in (*AXES, "camera"):
            try:
                device = bench.camera() if name == "camera" else bench.axis(name)
                text = device.identity()
            except DeviceError as error:
                text, failed = f"FAILED: {error}", failed + 1
            out.print(f"  {name}: {text}", highlight=False, soft_wrap=True)
    if failed:
        raise DeviceError(f"{failed} of the devices of {rig_path} cannot be used: see above")


def _motor(axis: str, rig: Rig) -> MotorAxis:
    """The settings of an axis that has a motor. Raises `InputError` where it has none."""
    if axis not in AXES:
        raise InputError(f"{axis!r} is no axis; allowed: {', '.join(AXES)}")
    settings = rig.axes[axis]
    if isinstance(settings, HandAxis):
        raise InputError(f"{axis} is set by hand on the rig {rig.name}: it has no motor to move")
    return settings


def _bare(rig_path: Path | None) -> Loaded:
    """A rig without a scan: where it is simulated, a white sample stands there."""
    if rig_path is None:
        raise InputError("name the rig file: --rig FILE")
    rig = load_rig(rig_path)
    protocol = Protocol.model_validate(
        {
            "name": "setting up",
            "rig": str(rig_path),
            "sample": {"name": "white", "width_mm": 50.0, "height_mm": 50.0},
            "sweeps": [{"theta_i_deg": [0.0], "dphi_deg": [0.0], "theta_r_deg": [0.0]}],
            "window": {"width_mm": WINDOW_MM, "height_mm": WINDOW_MM},
            "simulated_sample": {"model": "lambert", "parameters": {"albedo": 0.9}},
        }
    )
    return Loaded(protocol, rig_path, "", rig, rig_path, "")


def _confirm(rig: Rig, yes: bool, what: str) -> None:
    """Nothing real moves before somebody has said so."""
    if rig.real and not yes:
        nobody = f"{what}\nnobody to ask whether the rig is clear: add --yes"
        require_yes(f"{what} Is the rig clear?", nobody, "nothing has moved")
