"""Publisher: idle unless watched, whole files at any moment, and never in a scan's way."""

from __future__ import annotations

import logging
import socket
import stat
import threading
from pathlib import Path

import numpy as np
import pytest

from acquisition.live import channel
from acquisition.live.publisher import Publisher, Seen
from acquisition.measure.window import Window, window_at
from instrument.config.load import Loaded
from instrument.devices import Frame
from instrument.pinhole import Pinhole
from tests.support.timing.deadline import wait_for


@pytest.fixture
def folder(own_folder: Path) -> Path:
    return channel.user_folder() / "run"


@pytest.fixture
def window(demo: Loaded) -> Window:
    patch = demo.protocol.window
    return window_at(0.0, Pinhole.of(demo.rig), patch.width_mm, patch.height_mm)


def frame(demo: Loaded, level: int) -> Frame:
    camera = demo.rig.camera
    return Frame(np.full((camera.height_px, camera.width_px), level, np.uint16), 0.01, 0.0)


def test_nothing_is_written_until_somebody_watches_then_the_newest_frame_is(
    demo: Loaded, folder: Path, window: Window
) -> None:
    publisher = Publisher(folder, demo.rig.camera)
    with publisher.published(lambda: {"phase": "measuring"}, lambda _: channel.OK):
        for level in (100, 200, 300):
            publisher.show(Seen(frame(demo, level), window, {"step": level}))
        assert channel.read_state(folder) is None
        assert channel.send(folder, channel.WATCH) == channel.OK
        wait_for(lambda: channel.read_state(folder) is not None, "a state")
        state = channel.read_state(folder)
        assert state is not None
        assert state["phase"] == "measuring"
        assert (state["picture"]["step"], state["picture"]["number"]) == (300, 1)
        assert (channel.read_picture(folder) or b"").startswith(b"\xff\xd8")
        publisher.show(Seen(frame(demo, 400), window, {"step": 400}))
        wait_for(lambda: (channel.read_state(folder) or {})["picture"]["number"] == 2, "a picture")
    assert not folder.exists()


def test_the_socket_and_its_folder_are_open_to_their_user_alone(demo: Loaded, folder: Path) -> None:
    with Publisher(folder, demo.rig.camera).published(dict, lambda _: channel.OK):
        for path in (folder.parent, folder, folder / channel.SOCKET_FILE):
            assert stat.S_IMODE(path.stat().st_mode) == 0o700


def test_commands_are_answered_one_after_the_other_and_nonsense_is_refused(
    demo: Loaded, folder: Path
) -> None:
    followed: list[str] = []

    def follow(command: str) -> str:
        followed.append(command)
        return channel.OK if command != channel.ABORT else "the scan is ending"

    with Publisher(folder, demo.rig.camera).published(dict, follow):
        assert channel.send(folder, channel.PAUSE) == channel.OK
        assert channel.send(folder, channel.ABORT) == "the scan is ending"
        for text in ("", "rm", "pause pause", "\x00ß"):
            assert channel.send(folder, text).startswith("unknown command; allowed: watch, pause")
    assert followed == [channel.PAUSE, channel.ABORT]
    with pytest.raises(channel.NoScanError):
        channel.send(folder, channel.PAUSE)


def test_a_client_that_says_nothing_or_goes_away_costs_the_next_one_half_a_second(
    demo: Loaded, folder: Path
) -> None:
    with Publisher(folder, demo.rig.camera).published(dict, lambda _: channel.OK):
        for goes_away in (False, True):
            with socket.socket(socket.AF_UNIX) as silent:
                silent.connect(str(folder / channel.SOCKET_FILE))
                if goes_away:
                    silent.close()
                assert channel.send(folder, channel.PAUSE) == channel.OK


@pytest.mark.parametrize("trouble", ["others can enter", "a file is there", "name too long"])
def test_where_there_can_be_no_channel_the_scan_runs_and_the_log_says_why(
    demo: Loaded, folder: Path, trouble: str, caplog: pytest.LogCaptureFixture
) -> None:
    if trouble == "a file is there":
        channel.user_folder().write_text("")
    else:
        channel.user_folder().mkdir(mode=0o755 if trouble == "others can enter" else 0o700)
    folder = folder.with_name("x" * 120) if trouble == "name too long" else folder
    before = threading.active_count()
    with (
        caplog.at_level(logging.WARNING),
        Publisher(folder, demo.rig.camera).published(dict, lambda _: channel.OK),
    ):
        assert threading.active_count() == before
    assert "cannot be watched" in caplog.text


def test_a_folder_that_a_killed_scan_left_is_used_again(demo: Loaded, folder: Path) -> None:
    channel.user_folder().mkdir(mode=0o700)
    folder.mkdir()
    (folder / channel.SOCKET_FILE).write_text("")
    (folder / channel.STATE_FILE).write_text('{"phase": "measuring"}')
    with Publisher(folder, demo.rig.camera).published(dict, lambda _: channel.OK):
        assert channel.read_state(folder) is None
        assert channel.send(folder, channel.PAUSE) == channel.OK


def test_a_full_disk_ends_the_publishing_and_not_the_scan(
    demo: Loaded, folder: Path, window: Window, caplog: pytest.LogCaptureFixture
) -> None:
    publisher = Publisher(folder, demo.rig.camera)
    with publisher.published(dict, lambda _: channel.OK):
        (folder / "newest.part").mkdir()  # so that the file cannot be written
        publisher.show(Seen(frame(demo, 1), window, {}))
        assert channel.send(folder, channel.WATCH) == channel.OK
        wait_for(lambda: "not kept up to date" in caplog.text, "a warning")
        assert channel.send(folder, channel.PAUSE) == channel.OK
    assert not folder.exists()
