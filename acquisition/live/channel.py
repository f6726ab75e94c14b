"""Channel between a scan and those who watch it: where it is, and their side of it.

A scan that can be watched has a folder of its own, open to its user alone, with its present state,
its newest picture and a Unix socket for commands. The folder's name follows from the file of the
record, so that the run keeps no trace of it, and a moved run is still found.
"""

from __future__ import annotations

import json
import os
import socket
import stat
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

from instrument.errors import GonioError, StorageError

STATE_FILE, PICTURE_FILE, SOCKET_FILE = "state.json", "newest.jpg", "control"
WATCH, PAUSE, RESUME, ABORT = "watch", "pause", "resume", "abort"
COMMANDS = (WATCH, PAUSE, RESUME, ABORT)
OK = "ok"
WATCH_EVERY_S = 2.0
"""Time between two commands `watch` of a program that shows pictures."""
SCAN_EVERY_S, AIM_EVERY_S = 0.5, 0.2
"""Time between two pictures of a scan, which needs the computer, and of a lens that is turned."""
MOST_BYTES = 256
"""Of a command or its answer."""
_ANSWER_S = 1.0  # the scan's side answers from a thread of its own


class NoScanError(GonioError):
    """No scan of this run is under way, or it cannot be reached."""


def channel_of(record_file: Path) -> Path:
    """Return the folder of the channel of a run, whether or not a scan is under way.

    Raises `StorageError` if the record's file is missing.
    """
    try:
        file = record_file.stat()
    except OSError as error:
        raise StorageError(
            f"{record_file}: {error.strerror}: is the run's folder there?"
        ) from error
    return user_folder() / f"{file.st_dev:x}-{file.st_ino:x}"


def user_folder() -> Path:
    """Return the folder that holds the channels of this user."""
    return Path(tempfile.gettempdir()) / f"gonio-live-{os.getuid()}"


def is_private(folder: Path) -> bool:
    """Return True if a folder belongs to this user and nobody else can enter it."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    own = found.st_uid == os.getuid() and stat.S_ISDIR(found.st_mode)
    return own and not stat.S_IMODE(found.st_mode) & 0o077


def read_state(folder: Path) -> dict[str, Any] | None:
    """Return the scan's last published state, None without one: see `publisher.State`."""
    data = _read(folder, STATE_FILE)
    found: dict[str, Any] | None = None if data is None else json.loads(data)
    return found


def read_picture(folder: Path) -> bytes | None:
    """Return the newest picture as JPEG, None without one."""
    return _read(folder, PICTURE_FILE)


def send(folder: Path, command: str) -> str:
    """Send a command to the scan; return OK, or why it was not followed.

    Raises `NoScanError` if no scan answers.
    """
    if not is_private(folder.parent):
        raise NoScanError(f"{folder.parent}: no folder of this user alone")
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
            line.settimeout(_ANSWER_S)
            line.connect(str(folder / SOCKET_FILE))
            line.sendall(f"{command}\n".encode())
            answer = line.recv(MOST_BYTES).decode("utf-8", "replace").strip()
    except OSError as error:
        raise NoScanError(f"no scan answers: {error.strerror or error}") from None
    if not answer:
        raise NoScanError("no scan answers: it is ending")
    return answer


def _read(folder: Path, name: str) -> bytes | None:
    if is_private(folder.parent):
        with suppress(OSError):
            return (folder / name).read_bytes()
    return None
