"""Command `gonio grab`: one frame for aiming, with the measuring window drawn on it."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.commands.setup import require_rig
from acquisition.engine.exposure.search import ExposureSearch
from acquisition.live.aiming import Aiming
from acquisition.live.channel import AIM_EVERY_S, user_folder
from acquisition.live.page_process import live_page
from acquisition.live.picture import numbers_of
from acquisition.live.publisher import Publisher
from acquisition.measure.window import Window, window_at
from acquisition.plan.exposure_ladder import longest_exposure_s
from acquisition.results.model_check import check_model
from acquisition.rig import OpenRig, restart_for_emulated_camera
from acquisition.terminal.console import console, out
from acquisition.terminal.orderly_end import orderly_end
from instrument.clock import SystemClock
from instrument.config.load import load_protocol
from instrument.config.protocol import PatchConfig
from instrument.config.rig import Rig
from instrument.devices import Camera, Frame
from instrument.errors import InputError
from instrument.pinhole import Pinhole
from instrument.text.atomic_file import write_whole

# Outline that is drawn where no protocol gives its size.
DEFAULT_PATCH = PatchConfig(width_mm=20.0, height_mm=20.0)
_TARGET, _FIRST_EXPOSURE_S = 0.7, 0.01  # of full scale; the exposure with which the search begins
_DIM = 0.05  # of full scale: a window below it is nearly dark


def grab_frame(
    path: Path | None,
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
    if path is None:
        raise InputError("gonio grab: name a file with --out, or aim in a browser with --live")
    if path.suffix.lower() not in (".png", ".tif", ".tiff"):
        raise InputError(f"{path}: --out must end in .png (8 bit, drawn on) or .tiff (raw counts)")
    aimed = Aimed.of(rig_path, protocol_path, theta_r_deg, exposure_s)
    with aimed.camera() as camera:
        frame, identity = aimed.frame(camera), camera.identity()
    rig, window = aimed.rig, aimed.window
    with orderly_end():  # no half-written file stays
        write_whole(path, _encoded(frame, window, rig, path.suffix))
    statistics = _statistics(frame, window, rig)
    _print_statistics(statistics, identity, path, as_json)
    for warning in _warnings(statistics, rig):
        console.print(f"warning: {warning}", highlight=False, soft_wrap=True)


def aim_camera(
    rig_path: Path | None,
    protocol_path: Path | None,
    *,
    theta_r_deg: float,
    exposure_s: float | None,
) -> None:
    """Show the camera's picture in a browser, with a measure of focus, until Ctrl-C.

    Nothing moves, and no file is written.
    """
    aimed = Aimed.of(rig_path, protocol_path, theta_r_deg, exposure_s)
    channel = user_folder() / f"aim-{os.getpid()}"
    with (
        suppress(KeyboardInterrupt),
        aimed.camera() as camera,
        live_page(channel, aiming=True) as address,
    ):
        out.print(f"{address}\nCtrl-C ends it", highlight=False, soft_wrap=True)
        Aiming(
            publisher=Publisher(channel, aimed.rig.camera, every_s=AIM_EVERY_S),
            camera=aimed.rig.camera,
            window=aimed.window,
            take=lambda: aimed.frame(camera),
            clock=SystemClock(),
        ).run()


@dataclass(slots=True)
class Aimed:
    """Rig whose camera is aimed, the window at its present angle, and the exposure.

    `target` of the exposure is a share of full scale, where no `exposure_s` is given.
    """

    rig: Rig
    window: Window
    theta_r_deg: float
    target: float
    exposure_s: float | None
    _last_s: float = _FIRST_EXPOSURE_S

    @classmethod
    def of(
        cls,
        rig_path: Path | None,
        protocol_path: Path | None,
        theta_r_deg: float,
        exposure_s: float | None,
    ) -> Aimed:
        """Read the files; raise `InputError` before the camera is opened."""
        rig, patch, target = _rig_and_patch(rig_path, protocol_path)
        low, high = rig.camera.min_exposure_s, rig.camera.max_exposure_s
        if exposure_s is not None and not low <= exposure_s <= high:
            raise InputError(
                f"--exposure-s: {exposure_s:g} s; the camera can do {low:g} to {high:g} s"
            )
        window = window_at(theta_r_deg, Pinhole.of(rig), patch.width_mm, patch.height_mm)
        return cls(rig, window, theta_r_deg, target, exposure_s)

    @contextmanager
    def camera(self) -> Iterator[Camera]:
        """Open the camera in a `with` block, which a signal ends in order."""
        restart_for_emulated_camera(self.rig)
        with orderly_end(), OpenRig(self.rig) as open_rig:
            open_rig.pose_scene(self.theta_r_deg)
            yield open_rig.camera()

    def frame(self, camera: Camera) -> Frame:
        """Take one frame, at the exposure that suits the window if none is given."""
        if self.exposure_s is not None:
            camera.set_exposure_s(self.exposure_s)
            return camera.grab(1)[0]
        first_s = longest_exposure_s(self._last_s, self.rig.camera)
        search = ExposureSearch(camera, self.rig.camera, self.target)
        frame = search.frames(first_s, self.window)[-1]
        self._last_s = frame.exposure_s
        return frame


def _warnings(statistics: dict[str, float], rig: Rig) -> Iterator[str]:
    """Yield what keeps a frame from being a measurement, and what to do."""
    saturated, camera = statistics["saturated_pixels"], rig.camera
    if saturated:
        inside = statistics["window_saturated_pixels"]
        shorter = statistics["exposure_s"] > camera.min_exposure_s
        advice = "a shorter --exposure-s" if shorter else "less light"
        yield (
            f"{saturated:.0f} of {camera.width_px * camera.height_px} pixels are saturated (at "
            f"{camera.max_dn} DN; red in a .png), {inside:.0f} of them in the window"
            + (f": it needs {advice}" if inside else "")
        )
    signal = statistics["window_mean_dn"] - camera.black_level_dn
    if signal < _DIM * (camera.max_dn - camera.black_level_dn):
        yield (
            f"the window is nearly dark: {signal:.1f} DN above black_level_dn "
            f"{camera.black_level_dn:g}: light the sample, or take a longer --exposure-s"
        )


def _rig_and_patch(
    rig_path: Path | None, protocol_path: Path | None
) -> tuple[Rig, PatchConfig, float]:
    """Return the rig, the measured patch, and the target of the exposure."""
    if protocol_path is None:
        return require_rig(rig_path), DEFAULT_PATCH, _TARGET
    loaded = load_protocol(protocol_path, rig_path, check_model=check_model)
    return loaded.rig, loaded.protocol.window, loaded.protocol.exposure_target


def _statistics(frame: Frame, window: Window, rig: Rig) -> dict[str, float]:
    """Counts of the whole frame and of the window, in DN, by name."""
    numbers = numbers_of(frame, window, rig.camera)
    inside = frame.image[window.crop][window.counted]
    if numbers.window_mean_dn is None:
        raise InputError(
            "gonio grab: the window lies outside the picture: check axis_row_px and "
            "axis_column_px of the rig file"
        )
    return {
        "exposure_s": numbers.exposure_s,
        "frame_mean_dn": float(frame.image.mean()),
        "frame_max_dn": numbers.peak_dn,
        "window_mean_dn": numbers.window_mean_dn,
        "window_std_dn": float(inside.std()),
        "window_min_dn": float(inside.min()),
        "window_max_dn": float(inside.max()),
        "window_pixels": window.pixels,
        "saturated_pixels": float(numbers.saturated_pixels),
        "window_saturated_pixels": float(numbers.window_saturated_pixels),
        "full_scale_dn": numbers.full_scale_dn,
    }


def _print_statistics(
    statistics: dict[str, float], identity: str, path: Path, as_json: bool
) -> None:
    if as_json:
        sys.stdout.write(json.dumps({"camera": identity, "file": str(path), **statistics}) + "\n")
        return
    out.print(identity, highlight=False)
    for name, value in statistics.items():
        out.print(f"  {name:23} {value:.6g}", highlight=False)
    out.print(f"picture: {path}", highlight=False, soft_wrap=True)


def _encoded(frame: Frame, window: Window, rig: Rig, suffix: str) -> bytes:
    """Raw counts as TIFF, or an 8-bit PNG with the window's outline and the rotation axis.

    Saturated pixels of the PNG are red.
    """
    import cv2

    if suffix.lower() != ".png":
        return bytes(cv2.imencode(".tiff", frame.image)[1].tobytes())
    shown = np.clip(frame.image * (255.0 / rig.camera.max_dn), 0, 255).astype(np.uint8)
    drawn = cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR)
    drawn[frame.image >= rig.camera.max_dn] = (0, 0, 255)
    axis = (round(rig.camera.axis_column_px), round(rig.camera.axis_row_px))
    outline = np.round(window.outline_px * 16).astype(np.int32)
    cv2.polylines(drawn, [outline], True, (0, 200, 255), 1, cv2.LINE_AA, shift=4)
    cv2.drawMarker(drawn, axis, (0, 200, 255), cv2.MARKER_CROSS, 12, 1)
    return bytes(cv2.imencode(".png", drawn)[1].tobytes())
