"""Names of the files that a scan keeps of its frames, relative to the run's folder."""

from __future__ import annotations

import re
from pathlib import Path

FOLDER, CELLS_FOLDER = "frames", "cells"
_FRAME = re.compile(rf"{FOLDER}/(\d{{6,}})-\d{{4,}}\.tiff", re.ASCII)


def frame_name(step: int, number: int) -> str:
    """Return the file of a step's frame, counted from 0."""
    return f"{FOLDER}/{step:06d}-{number:04d}.tiff"


def dark_name(exposure_s: float) -> str:
    """Return the file of the mean dark of an exposure: linear counts as 32-bit floats."""
    return f"{FOLDER}/dark-{exposure_s:.9g}s.tiff"


def cells_name(step: int) -> str:
    """Return the file of the light of the cells at a step, for protocols with `maps`."""
    return f"{CELLS_FOLDER}/{step:06d}.npy"


def has_kept(run: Path) -> bool:
    """Return True if a run's folder has frames or cells."""
    return any((run / name).is_dir() for name in (FOLDER, CELLS_FOLDER))


def step_of(name: str) -> int | None:
    """Return the step whose frame a file is by its name; None for any other name."""
    found = _FRAME.fullmatch(name)
    return int(found[1]) if found else None
