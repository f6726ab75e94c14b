"""Detection of network file systems, on which SQLite's write-ahead log is not safe.

SQLite's documentation of the write-ahead log: "All processes using a database must be on the same
host computer; WAL does not work over a network filesystem."
"""

from __future__ import annotations

import re
from pathlib import Path

_MOUNTS = Path("/proc/self/mountinfo")
_NETWORK = frozenset(
    {"nfs", "nfs4", "cifs", "smb3", "smbfs", "9p", "afs", "ceph", "glusterfs", "lustre", "ncpfs"}
)
_FUSE_NETWORK = frozenset(
    {"fuse.sshfs", "fuse.rclone", "fuse.s3fs", "fuse.davfs", "fuse.glusterfs"}
)


def network_share(folder: Path, mounts: Path = _MOUNTS) -> str | None:
    """Return the network file system on which `folder` is or would be made; None on a local disk.

    None, too, if the system keeps no list of its mounts.
    """
    try:
        lines = mounts.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    place = folder.resolve()
    kinds = dict(filter(None, map(_mount, lines)))  # the last mount hides earlier ones
    nearest = next((kinds[str(p)] for p in (place, *place.parents) if str(p) in kinds), "")
    return nearest if nearest in _NETWORK | _FUSE_NETWORK else None


def _mount(line: str) -> tuple[str, str] | None:
    """Return mount point and file system of a line of mountinfo, as in proc(5)."""
    left, found, right = line.partition(" - ")
    fields = left.split(" ")
    if not found or len(fields) < 5:
        return None
    return _unescaped(fields[4]), right.split(" ")[0]


def _unescaped(text: str) -> str:
    """Replace the octal escapes of mountinfo, such as `\\040` for a blank."""
    return re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), text)
