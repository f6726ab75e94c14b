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

from acquisition.measure.radiometry import Dark
from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.kept_files import (
    CELLS_FOLDER,
    FOLDER,
    cells_name,
    dark_name,
    frame_name,
)
from acquisition.measure.rectify.light import FloatImage, light_dn
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


def write_frames(frames: Sequence[Frame], step: int, run: Path) -> list[str]:
    """Write raw counts as TIFF into the run's folder; return the names relative to it.

    Raises `StorageError` if a file cannot be written, or would be written outside the run.
    """
    names = [frame_name(step, number) for number in range(len(frames))]
    _write({name: frame.image for name, frame in zip(names, frames, strict=True)}, run)
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
        light = light_dn(
            [frame.image for frame in frames], dark.mean, dark.hot, rig.camera, Pinhole.of(rig)
        )
        _write_cells(light, frames[0].image, reading, protocol, rig, run)
    return write_frames(frames, reading.step, run) if protocol.keep_frames else []


def _write_cells(
    light: FloatImage,
    image: NDArray[Any],
    reading: Reading,
    protocol: Protocol,
    rig: Rig,
    run: Path,
) -> None:
    """Write the light of the window, then of each cell, as 32-bit floats in DN."""
    assert protocol.maps is not None
    grid, pinhole = CellGrid.of(protocol.sample, rig, protocol.maps.cell_mm), Pinhole.of(rig)
    window, cells = cells_of(light, image, reading.theta_r_deg, grid, pinhole, protocol)
    file = io.BytesIO()
    np.save(file, np.concatenate([np.array([window], dtype=np.float32), cells.ravel()]))
    try:
        make_folder(run / CELLS_FOLDER)
        write_whole(run / cells_name(reading.step), file.getvalue(), linked_folder=False)
    except OSError as error:
        raise StorageError(f"{run / CELLS_FOLDER}: {explain_os_error(error, run)}") from error


def write_dark(dark: Dark, run: Path) -> None:
    """Write the mean dark of an exposure, linear counts as 32-bit floats, into the run's folder.

    One that is taken again replaces it. Raises `StorageError` as `write_frames` does.
    """
    _write({dark_name(dark.exposure_s): dark.mean.astype(np.float32)}, run)


def _write(images: Mapping[str, NDArray[Any]], run: Path) -> None:
    import cv2

    try:
        make_folder(run / FOLDER)
        for name, image in images.items():
            data = cv2.imencode(".tiff", image)[1].tobytes()
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
    return 4 * grid.rows * grid.columns * points


def frame_bytes(plan: Plan, loaded: Loaded) -> int:
    """Return the disk space for the frames of a whole scan; 0 if none are kept."""
    camera = loaded.rig.camera
    if not loaded.protocol.keep_frames:
        return 0
    frame = camera.width_px * camera.height_px * (1 if camera.bit_depth == 8 else 2)
    return frame * sum(step.frames for step in plan.steps)


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
