"""Pictures of the page as JPEG: the newest of the scan, and those that a run has kept."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import cv2
import numpy as np

from acquisition.live.channel import read_picture, read_state
from acquisition.live.following.run_reader import RunReader
from acquisition.live.picture import jpeg_of
from instrument.devices import Image

_MOST_BYTES = 256 * 1024**2  # of a frame's file
_PREVIEW_MAX = 255  # of its 8 bits: where all of a pixel was saturated


def newest_picture(channel: Path, number: int) -> bytes | None:
    """Return the scan's picture with this number, None if it is not the newest any more."""
    state = read_state(channel)
    picture = None if state is None else state["picture"]
    return read_picture(channel) if picture and picture["number"] == number else None


def kept_picture(reader: RunReader, step: int) -> bytes | None:
    """Return the first frame of a step, else the record's own picture of it; None without one."""
    name, folder = reader.frame_file(step), reader.folder
    data = None if name is None or folder is None else _file_inside(folder, name)
    frame = None if data is None else _decoded(data)
    if frame is not None:
        return jpeg_of(frame, reader.loaded.rig.camera.max_dn)
    preview = reader.preview(step)
    small = None if preview is None else _decoded(preview.png)
    return None if small is None else jpeg_of(small, _PREVIEW_MAX)


def _decoded(data: bytes) -> Image | None:
    """Return a grey picture (rows, columns), None for bytes that are none."""
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # of a size that no camera has
        return None
    if image is None or image.ndim != 2 or image.dtype not in (np.uint8, np.uint16):
        return None
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return image.astype(np.uint16, copy=False)


def _file_inside(run: Path, name: str) -> bytes | None:
    """Return a file of a run, None if it is missing, a link or no file, or too large."""
    folder, _, file = name.partition("/")
    try:
        inside = os.open(run / folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        number = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=inside)
    except OSError:
        return None
    finally:
        os.close(inside)
    with os.fdopen(number, "rb") as opened:
        found = os.fstat(number)
        if not stat.S_ISREG(found.st_mode) or found.st_size > _MOST_BYTES:
            return None
        return opened.read()
