"""Network file systems are recognised by the list of mounts."""

from __future__ import annotations

from pathlib import Path

import pytest

from instrument.text.network_share import network_share

MOUNTS = r"""22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
30 22 0:50 / /lab rw,relatime shared:2 - nfs4 server:/lab rw
31 30 8:2 / /lab/local rw - xfs /dev/sdb1 rw
32 22 0:51 / /with\040blank rw - cifs //server/share rw
33 22 0:52 / /far rw - fuse.sshfs me@server: rw
broken line
"""


@pytest.mark.parametrize(
    ("folder", "kind"),
    [("/home/run", None), ("/lab/run", "nfs4"), ("/lab/local/run", None), ("/laboratory", None),
     ("/with blank/a/b", "cifs"), ("/far", "fuse.sshfs")],
)  # fmt: skip
def test_a_network_share_is_recognised_by_its_mount(tmp_path: Path, folder: str, kind: str) -> None:
    (tmp_path / "mounts").write_text(MOUNTS)
    assert network_share(Path(folder), tmp_path / "mounts") == kind
    assert network_share(Path(folder), tmp_path / "none") is None
