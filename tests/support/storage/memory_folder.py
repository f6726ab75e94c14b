"""Folder in memory for the files of tests: a scan commits each reading, and disks take 3 ms each.

What survives a power cut is told from recorded writes, wherever they go.
"""

from __future__ import annotations

import os
from pathlib import Path

RAM = Path("/dev/shm")
_ROOM_BYTES = 4 * 2**30  # the files of a whole test run take a third of it


def has_room(folder: Path) -> bool:
    """Return True for a folder in which files can be made and libraries loaded, with ample room."""
    if not os.access(folder, os.W_OK | os.X_OK):
        return False
    state = os.statvfs(folder)
    return not state.f_flag & os.ST_NOEXEC and state.f_bavail * state.f_frsize > _ROOM_BYTES
