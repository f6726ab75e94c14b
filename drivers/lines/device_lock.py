"""Lock on a device, so that one program at a time opens it.

A serial port can be locked itself; a Modbus gateway lets any number of programs in, and a camera
takes a second program's settings before it refuses the stream.
"""

from __future__ import annotations

import contextlib
import fcntl
import logging
import os
import tempfile
from pathlib import Path
from typing import Protocol
from urllib.parse import quote

from instrument.closeable import Closeable
from instrument.errors import DeviceError
from instrument.processes import locking, named

_FOLDERS = (Path("/run/lock"), Path(tempfile.gettempdir()))  # the first is Debian's, for all users

log = logging.getLogger(__name__)


class DeviceInUse(DeviceError):
    """Another program has opened the device, or this one has opened it before."""


class DeviceLock(Closeable):
    """Lock on a device by its name in the rig file; it ends with the process at the latest.

    A path at which there is nothing is not locked. Where no file can be made for the lock, that is
    logged and the device is used without.
    """

    def __init__(self, who: str, device: str) -> None:
        self._descriptor: int | None = None
        if device.startswith("/") and not Path(device).exists():
            return
        self._descriptor = _lock_file(device)
        if self._descriptor is None:
            log.warning("%s: %s: another program that uses it would not be noticed", who, device)
            return
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            holder = _holder(self._descriptor)
            self.close()
            raise DeviceInUse(
                f"{who}: {device} is in use by {holder}: wait for its end, or stop it; nothing "
                "was sent to the device"
            ) from error

    def close(self) -> None:
        """End the lock; safe to call twice."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)


class HasFileno(Protocol):
    """Open port or socket."""

    def fileno(self) -> int:
        """Return its file descriptor."""
        ...


def unlock(port: HasFileno) -> None:
    """End the lock on a port that is about to be closed.

    Closing alone leaves the port locked while another thread still waits for its bytes, and it
    could not be opened again at once.
    """
    with contextlib.suppress(OSError, ValueError):  # it is gone, or has no lock
        fcntl.flock(port, fcntl.LOCK_UN)


def _lock_file(device: str) -> int | None:
    """Open the device's lock file in the first folder where that is possible.

    Another user's file can be locked too, but Linux may refuse to create it again
    (fs.protected_regular). It is never removed: a program may just be about to lock it.
    """
    for folder in _FOLDERS:
        path = folder / f"gonio-{quote(device.lower(), safe='')}.lock"
        for more in (0, os.O_CREAT):
            try:
                return os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC | more, 0o644)
            except OSError:
                continue
    return None


def _holder(descriptor: int) -> str:
    found = list(locking(Path(f"/proc/self/fd/{descriptor}")))
    if os.getpid() in found:
        return "this program, which has opened it before"
    return ", ".join(map(named, found)) or "another program"
