"""Single frames of a V4L2 stream: failed requests, torn frames, frozen streams."""

from __future__ import annotations

import errno
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from instrument.errors import DeviceError
from sim.emulated.v4l2.device import Exposure
from tests.support.v4l2.remote_camera import (
    FOUND_WITHIN_S,
    SETTINGS,
    WHO,
    LevelScene,
    RemoteCamera,
    level,
    served,
)

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize("request_name", ["DQBUF", "QBUF", "QUERYBUF", "G_CTRL"])
@pytest.mark.parametrize("error", [errno.EIO, errno.EINVAL])
def test_a_single_failed_request_is_harmless(
    remote: RemoteCamera, scene: LevelScene, request_name: str, error: int
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        for change in range(1, 4):
            scene.level = change
            camera.faults.fail(request_name, error)
            assert [level(frame) for frame in remote.grab(6)] == [change] * 6
            assert not camera.faults.failing[request_name]
            if request_name == "QBUF":
                remote.ask("open", SETTINGS)  # each one costs the stream a buffer
        assert camera.requests["STREAMON"] == (4 if request_name == "QBUF" else 1)


@pytest.mark.parametrize("kind", ["flagged", "short"])
def test_torn_frames_are_rejected_and_replaced(
    remote: RemoteCamera, scene: LevelScene, kind: str
) -> None:
    """A short frame keeps the old content of its buffer's end; all rows are checked."""

    def render(exposure: Exposure, seen: object) -> NDArray[Any]:
        shape = (exposure.height_px, exposure.width_px)
        return np.full(shape, exposure.sequence % 65536, np.uint16)

    scene.render = render  # type: ignore[method-assign]  # another picture
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.grab(1)
        for _ in range(3):
            remote.begin("grab", 30)
            scene.wait_exposures(8)
            camera.faults.bad_frames.extend([kind] * 3)  # type: ignore[list-item]  # one of the two
            frames = remote.answer()
            assert not camera.faults.bad_frames
            values = [np.unique(frame.image) for frame in frames]
            assert all(len(value) == 1 for value in values)
            gaps = np.diff([int(value[0]) for value in values])
            assert gaps.max() >= 4  # the three are not among them


@pytest.mark.parametrize(
    ("kind", "message"),
    [("flagged", "was flagged as bad by the driver"), ("short", "had 3072 of 6144 bytes")],
)
def test_torn_frames_in_a_series_are_an_error(
    remote: RemoteCamera, scene: LevelScene, kind: str, message: str
) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        camera.faults.bad_frames.extend([kind] * 40)  # type: ignore[list-item]  # one of the two
        with pytest.raises(DeviceError, match=f"{WHO}: 4 bad frames in a series, .*{message}"):
            remote.grab(1)
        camera.faults.bad_frames.clear()
        assert len(remote.grab(2)) == 2


def test_counts_beyond_the_bit_depth_are_an_error(remote: RemoteCamera, scene: LevelScene) -> None:
    settings = replace(SETTINGS, bit_depth=12)
    with served(remote, scene):
        remote.ask("open", settings)
        scene.level = 4095
        assert level(remote.grab(1)[0]) == 4095
        scene.level = 4096
        with pytest.raises(
            DeviceError, match=f"{WHO}: a pixel has 4096 counts, 12 bits allow 4095: .*left-aligned"
        ):
            remote.grab(1)


def test_a_frozen_stream_is_found_without_its_descriptor(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    """Without the descriptor OpenCV waits, in whole seconds."""
    with served(remote, scene) as camera:
        remote.ask("open_blind", SETTINGS)
        camera.faults.frozen = True
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match="stands still"):
            remote.grab(8)
        assert time.monotonic() - start_s < 0.001 + FOUND_WITHIN_S + 0.5


def test_a_driver_that_does_not_report_torn_frames(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene, reports_filled=False):
        assert "does not report torn frames" in remote.ask("open", SETTINGS)
        scene.level = 3
        assert [level(frame) for frame in remote.grab(3)] == [3, 3, 3]


def test_a_stream_whose_descriptor_is_not_found(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene):
        assert "does not report torn frames" in remote.ask("open_blind", SETTINGS)
        scene.level = 3
        assert [level(frame) for frame in remote.grab(3)] == [3, 3, 3]
