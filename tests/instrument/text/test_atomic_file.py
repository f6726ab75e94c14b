"""Files are written whole or not at all, and read only where they are files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from instrument.errors import InputError, StorageError
from instrument.text.atomic_file import read_file, write_whole


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "fit.json"
    write_whole(path, "old")

    def full(number: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=r"fit\.json: the disk is full .*make room"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["fit.json"]


def test_a_link_in_the_way_is_replaced_not_followed(tmp_path: Path) -> None:
    """Under the name of the file and under the temporary one."""
    victim = tmp_path / "mine.txt"
    victim.write_text("mine")
    for name in ("fit.json", f".fit.json.{os.getpid()}.part"):
        (tmp_path / name).symlink_to(victim)
    write_whole(tmp_path / "fit.json", "new")
    assert victim.read_text() == "mine"
    assert (tmp_path / "fit.json").read_text() == "new"
    assert not (tmp_path / "fit.json").is_symlink()


def test_a_file_is_read_to_one_byte_past_the_limit(tmp_path: Path) -> None:
    """So that the reader can see that there is more."""
    (tmp_path / "a").write_bytes(b"12345")
    assert read_file(tmp_path / "a", 3) == b"1234"
    assert read_file(tmp_path / "a", 9) == b"12345"


def test_a_pipe_is_refused_unless_it_is_allowed(tmp_path: Path) -> None:
    """Reading it would wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="it is a device, a pipe or a socket, not a file"):
        read_file(tmp_path / "pipe", 10)


@pytest.mark.parametrize("links", [True, False])
def test_a_new_file_replaces_nothing(
    links: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also on a disk without hard links, and where the name was taken since it was looked at."""

    def no_link(*arguments: object, **options: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    if not links:
        monkeypatch.setattr(os, "link", no_link)
    write_whole(tmp_path / "rig.yaml", "new", new=True)
    (tmp_path / "mine.yaml").symlink_to(tmp_path / "nowhere")
    for name in ("rig.yaml", "mine.yaml"):
        with pytest.raises(InputError, match=f"{name}: exists already: choose another name"):
            write_whole(tmp_path / name, "other", new=True)
    assert (tmp_path / "rig.yaml").read_text() == "new"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine.yaml", "rig.yaml"]
