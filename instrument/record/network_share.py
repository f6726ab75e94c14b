"""On which kind of file system a folder lies: the record's write-ahead log needs a local one.

SQLite's documentation of the write-ahead log: all processes must be on the same computer; it does
not work over a network file system.
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
    """The network file system that `folder` lies on or would be made on; None on a local disk.

    None, too, where the system keeps no list of its mounts.
    """
    try:
        lines = mounts.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return None
    place = folder.resolve()
    kinds = dict(filter(None, map(_mount, lines)))  # of one place the last mount is what is seen
    nearest = next((kinds[str(p)] for p in (place, *place.parents) if str(p) in kinds), "")
    return nearest if nearest in _NETWORK | _FUSE_NETWORK else None


def _mount(line: str) -> tuple[str, str] | None:
    """Where a line of mountinfo mounts what kind of file system; see proc(5)."""
    left, found, right = line.partition(" - ")
    fields = left.split(" ")
    if not found or len(fields) < 5:
        return None
    return _unescaped(fields[4]), right.split(" ")[0]


def _unescaped(text: str) -> str:
    """Blanks and the like stand as three octal digits."""
    return re.sub(r"\\([0-7]{3})", lambda octal: chr(int(octal[1], 8)), text)
