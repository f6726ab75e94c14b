"""TIFF files of all frames and darks, for protocols with `keep_frames`.

The frames of a step are written before its reading.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.radiometry import Dark
from acquisition.measure.rectify.kept_files import FOLDER, dark_name, frame_name
from acquisition.plan.plan import Plan
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import explain_os_error, make_folder, write_whole


def write_frames(frames: Sequence[Frame], step: int, run: Path) -> list[str]:
    """Write raw counts as TIFF into the run's folder; return the names relative to it.

    Raises `StorageError` if a file cannot be written, or would be written outside the run.
    """
    names = [frame_name(step, number) for number in range(len(frames))]
    _write({name: frame.image for name, frame in zip(names, frames, strict=True)}, run)
    return names


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
    """Raise `InputError` if frames are kept and their folder is a link or no folder.

    The run may come from anybody, and its frames would be written wherever the link leads.
    """
    path = run / FOLDER
    if loaded.protocol.keep_frames and (path.is_symlink() or (path.exists() and not path.is_dir())):
        raise InputError(
            f"{path}: is a link or no folder; allowed: a folder, or nothing: move it away"
        )


def frame_bytes(plan: Plan, loaded: Loaded) -> int:
    """Return the disk space for the frames of a whole scan; 0 if none are kept."""
    camera = loaded.rig.camera
    if not loaded.protocol.keep_frames:
        return 0
    frame = camera.width_px * camera.height_px * (1 if camera.bit_depth == 8 else 2)
    return frame * sum(step.frames for step in plan.steps)


def require_disk_space(plan: Plan, loaded: Loaded, folder: Path) -> None:
    """Raise `InputError` if the frames to be kept do not fit on the run's disk."""
    needed = frame_bytes(plan, loaded)
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    free = shutil.disk_usage(existing).free
    if needed > free:
        raise InputError(
            f"{loaded.protocol_path}: keep_frames: the frames need {needed / 1e9:.2f} GB, and "
            f"{existing} has {free / 1e9:.2f} GB free: name another disk with --out, or keep none"
        )
