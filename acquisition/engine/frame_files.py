"""Files of frames: TIFF of all and of darks for `keep_frames`, and cells for `maps`.

Those of a step are written before its reading.
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.hot_pixels import find_hot_pixels
from acquisition.measure.radiometry import Dark
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.kept_files import (
    CELLS_FOLDER,
    FOLDER,
    cells_name,
    dark_name,
    frame_name,
)
from acquisition.measure.rectify.light import FloatImage, channels_of, light_dn, window_dn
from acquisition.measure.rectify.of_sample import cells_of
from acquisition.plan.plan import Plan
from instrument.config.load import Loaded
from instrument.config.protocol import Protocol
from instrument.config.rig import Rig
from instrument.devices import Frame
from instrument.errors import InputError, StorageError
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading
from instrument.text.atomic_file import explain_os_error, make_folder, write_whole

_PLANE = 2  # axes of a picture without colour


def write_frames(frames: Sequence[Frame], step: int, run: Path) -> list[str]:
    """Write raw counts as TIFF into the run's folder; return the names relative to it.

    Those of a colour camera have its three channels. Raises `StorageError` if a file cannot be
    written, or would be written outside the run.
    """
    names = [frame_name(step, number) for number in range(len(frames))]
    _write({name: _counts(frame) for name, frame in zip(names, frames, strict=True)}, run)
    return names


def write_kept(
    reading: Reading,
    frames: Sequence[Frame],
    dark: Dark,
    protocol: Protocol,
    rig: Rig,
    run: Path,
) -> list[str]:
    """Write what the protocol keeps of a reading's frames; return the names of the frames' files.

    Raises `StorageError` as `write_frames` does.
    """
    if protocol.maps is not None and reading.kind == "point":
        lights = _lights(frames, dark, rig)
        _write_cells(_of_cells(lights, frames[0].image, reading, protocol, rig), reading.step, run)
    elif protocol.maps is not None and rig.camera.is_colour and reading.kind == "tile":
        patch, pinhole = protocol.window, Pinhole.of(rig)
        lights = _lights(frames, dark, rig)
        windows = [window_dn(light, reading.theta_r_deg, pinhole, patch) for light in lights]
        _write_cells(np.array(windows, dtype=np.float32), reading.step, run)
    return write_frames(frames, reading.step, run) if protocol.keep_frames else []


def _counts(frame: Frame) -> NDArray[Any]:
    """Return a frame's counts: (rows, columns), or (rows, columns, 3) of a colour camera."""
    return frame.image if frame.colour is None else frame.colour


def _lights(frames: Sequence[Frame], dark: Dark, rig: Rig) -> list[FloatImage]:
    """Return the light of each pixel in DN, one picture (rows, columns) for each channel."""
    camera, pinhole = rig.camera, Pinhole.of(rig)
    if dark.colour is None:
        images = [frame.image for frame in frames]
        return [light_dn(images, dark.mean, dark.hot, camera, pinhole)]
    pictures = zip(*(channels_of(_counts(frame)) for frame in frames), strict=True)
    return [
        light_dn(images, own, find_hot_pixels(own, camera), camera, pinhole)
        for images, own in zip(pictures, channels_of(dark.colour), strict=True)
    ]


def _of_cells(
    lights: Sequence[FloatImage],
    image: NDArray[Any],
    reading: Reading,
    protocol: Protocol,
    rig: Rig,
) -> NDArray[np.float32]:
    """Return the light of the window, then of each cell, in DN, of one channel after another."""
    assert protocol.maps is not None
    grid, pinhole = CellGrid.of(protocol.sample, rig, protocol.maps.cell_mm), Pinhole.of(rig)
    found = []
    for light in lights:
        window, cells = cells_of(light, image, reading.theta_r_deg, grid, pinhole, protocol)
        found += [np.array([window], dtype=np.float32), cells.ravel()]
    return np.concatenate(found)


def _write_cells(values: NDArray[np.float32], step: int, run: Path) -> None:
    file = io.BytesIO()
    np.save(file, values)
    try:
        make_folder(run / CELLS_FOLDER)
        write_whole(run / cells_name(step), file.getvalue(), linked_folder=False)
    except OSError as error:
        raise StorageError(f"{run / CELLS_FOLDER}: {explain_os_error(error, run)}") from error


def write_dark(dark: Dark, run: Path) -> None:
    """Write the mean dark of an exposure, linear counts as 32-bit floats, into the run's folder.

    One that is taken again replaces it. Raises `StorageError` as `write_frames` does.
    """
    mean = dark.mean if dark.colour is None else dark.colour
    _write({dark_name(dark.exposure_s): mean.astype(np.float32)}, run)


def _write(images: Mapping[str, NDArray[Any]], run: Path) -> None:
    import cv2

    try:
        make_folder(run / FOLDER)
        for name, image in images.items():
            ordered = image if image.ndim == _PLANE else image[..., ::-1]  # as OpenCV has them
            data = cv2.imencode(".tiff", ordered)[1].tobytes()
            write_whole(run / name, data, linked_folder=False)
    except OSError as error:
        raise StorageError(f"{run / FOLDER}: {explain_os_error(error, run)}") from error


def require_own_folder(loaded: Loaded, run: Path) -> None:
    """Raise `InputError` if frames or cells are kept and their folder is a link or no folder.

    The run may come from anybody, and its frames would be written wherever the link leads.
    """
    kept = {FOLDER: loaded.protocol.keep_frames, CELLS_FOLDER: loaded.protocol.maps is not None}
    for path in (run / name for name, is_kept in kept.items() if is_kept):
        if path.is_symlink() or (path.exists() and not path.is_dir()):
            raise InputError(
                f"{path}: is a link or no folder; allowed: a folder, or nothing: move it away"
            )


def cell_bytes(plan: Plan, loaded: Loaded) -> int:
    """Return the disk space for the cells of a whole scan; 0 if none are kept.

    Raises `InputError` for a size of cells that the camera does not resolve.
    """
    protocol = loaded.protocol
    if protocol.maps is None:
        return 0
    try:
        grid = CellGrid.of(protocol.sample, loaded.rig, protocol.maps.cell_mm)
    except InputError as error:
        raise InputError(f"{loaded.protocol_path}: maps: {error}") from None
    points = sum(step.kind == "point" for step in plan.steps)
    return 4 * grid.rows * grid.columns * points * loaded.rig.camera.channels


def frame_bytes(plan: Plan, loaded: Loaded) -> int:
    """Return the disk space for the frames of a whole scan; 0 if none are kept."""
    camera = loaded.rig.camera
    if not loaded.protocol.keep_frames:
        return 0
    frame = camera.width_px * camera.height_px * (1 if camera.bit_depth == 8 else 2)
    return frame * camera.channels * sum(step.frames for step in plan.steps)


def require_disk_space(plan: Plan, loaded: Loaded, folder: Path) -> None:
    """Raise `InputError` if the frames and cells to be kept do not fit on the run's disk."""
    needed = frame_bytes(plan, loaded) + cell_bytes(plan, loaded)
    key = "keep_frames: the frames" if loaded.protocol.keep_frames else "maps: the cells"
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(existing).free
    if needed > free:
        raise InputError(
            f"{loaded.protocol_path}: {key} need {needed / 1e9:.2f} GB, and "
            f"{existing} has {free / 1e9:.2f} GB free: name another disk with --out, or keep none"
        )
