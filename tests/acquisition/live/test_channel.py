"""Channel: private to its user, found again by the record's file, silent where no scan is."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.live import channel
from instrument.errors import StorageError

pytestmark = pytest.mark.usefixtures("own_folder")


def test_the_channel_of_a_run_follows_its_record_wherever_the_run_is_moved(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    (run / "record.sqlite").write_bytes(b"")
    before = channel.channel_of(run / "record.sqlite")
    moved = run.rename(tmp_path / "moved")
    (tmp_path / "other").write_bytes(b"")
    assert channel.channel_of(moved / "record.sqlite") == before
    assert channel.channel_of(tmp_path / "other") != before


def test_a_run_whose_record_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"record\.sqlite: .*is the run's folder there\?"):
        channel.channel_of(tmp_path / "record.sqlite")


@pytest.mark.parametrize("mode", [0o755, 0o710, 0o701])
def test_a_folder_that_others_can_enter_is_not_read(tmp_path: Path, mode: int) -> None:
    folder = channel.user_folder() / "run"
    folder.mkdir(parents=True)
    (folder / channel.STATE_FILE).write_text("{}")
    channel.user_folder().chmod(0o700)
    assert channel.read_state(folder) == {}
    channel.user_folder().chmod(mode)
    assert channel.read_state(folder) is None
    with pytest.raises(channel.NoScanError, match="no folder of this user alone"):
        channel.send(folder, channel.PAUSE)


def test_a_link_to_a_private_folder_is_not_followed(tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir(mode=0o700)
    channel.user_folder().symlink_to(elsewhere)
    assert not channel.is_private(channel.user_folder())


def test_without_a_scan_a_command_says_so(tmp_path: Path) -> None:
    channel.user_folder().mkdir(mode=0o700)
    with pytest.raises(channel.NoScanError, match="no scan answers: No such file"):
        channel.send(channel.user_folder() / "run", channel.PAUSE)
    assert channel.read_picture(channel.user_folder() / "run") is None
