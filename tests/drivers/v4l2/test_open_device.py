"""Opening a V4L2 camera: every setting is read back, and errors state the values."""

from __future__ import annotations

import errno
import re
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.v4l2 import ioctl
from instrument.config.camera import CameraDefects
from instrument.errors import DeviceError
from sim.emulated.v4l2.device import CameraFaults
from tests.support.v4l2.remote_camera import (
    DEVICE,
    FOUND_WITHIN_S,
    SETTINGS,
    WHO,
    LevelScene,
    RemoteCamera,
    served,
)

pytestmark = pytest.mark.real_time


def fault(**values: Any) -> Callable[[CameraFaults], None]:
    def apply(faults: CameraFaults) -> None:
        for name, value in values.items():
            setattr(faults, name, value)

    return apply


OPENING = [
    (
        fault(substitute_format="GREY"),
        {},
        "format Y16 asked for, the camera took GREY; it offers GREY, Y10, Y16, YUYV",
    ),
    (
        fault(substitute_size=(640, 480)),
        {},
        "size 64 x 48 pixels asked for, the camera took 640 x 480; it offers 640 x 480, 512 x 480",
    ),
    (
        fault(clamped_exposure=50),
        {"min_exposure_s": 0.01},
        "exposure 0.01 s asked for, the camera took 0.005 s",
    ),
    (
        fault(),
        {"max_exposure_s": 20.0},
        "exposure 20 s asked for; the camera allows 0.0001 s to 10 s",
    ),
    (fault(), {"gain": 485}, "gain 485 asked for; the camera allows 0 to 480 in steps of 10"),
    (fault(), {"gain": 105}, "gain 105 asked for, the camera took 100; .* in steps of 10"),
    (
        fault(stuck_controls={ioctl.EXPOSURE_AUTO}),
        {},
        "manual exposure, which is mode 1 asked for, the camera took 3",
    ),
    (
        fault(stuck_controls={ioctl.AUTOGAIN}),
        {},
        "automatic gain 0 asked for, the camera took 1",
    ),
    (
        fault(stuck_controls={ioctl.AUTO_WHITE_BALANCE}),
        {},
        "automatic white balance 0 asked for, the camera took 1",
    ),
    (fault(stuck_controls={ioctl.GAMMA}), {}, "gamma 1 asked for, the camera took 2.2"),
    (
        fault(refused_controls={ioctl.GAIN}),
        {},
        r"gain 100 asked for; the camera refused it \(Permission denied\)",
    ),
    (fault(gives_no_buffers=True), {}, "is there, but OpenCV cannot open it: no buffers"),
    (
        lambda faults: faults.fail("STREAMON", errno.ENOSPC),
        {},
        "the stream could not be started.*USB hub",
    ),
    (
        lambda faults: faults.fail("open", errno.EACCES),
        {},
        r"cannot be opened \(Permission denied\)",
    ),
    (fault(frozen=True), {}, "no frame for .* the stream stands still.*USB cable"),
]


@pytest.mark.parametrize(("spoil", "changes", "message"), OPENING)
def test_a_failed_opening_states_the_request_and_the_answer(
    remote: RemoteCamera,
    scene: LevelScene,
    spoil: Callable[[CameraFaults], None],
    changes: dict[str, Any],
    message: str,
) -> None:
    with served(remote, scene) as camera:
        spoil(camera.faults)
        with pytest.raises(DeviceError, match=f"^camera .*{re.escape(DEVICE)}.?: {message}"):
            remote.ask("open", replace(SETTINGS, **changes))


def test_padded_rows_are_refused(remote: RemoteCamera, scene: LevelScene) -> None:
    with (
        served(remote, scene, row_padding_bytes=32),
        pytest.raises(DeviceError, match="a row has 160 bytes, 128 of them pixels"),
    ):
        remote.ask("open", SETTINGS)


LIMITED = {"quantization": ioctl.LIMITED_RANGE}
UNSTATED = {"quantization": ioctl.DEFAULT_RANGE}  # of sRGB, which means limited
YUYV = replace(SETTINGS, pixel_format="YUYV", bit_depth=8)


@pytest.mark.parametrize("declared", [LIMITED, UNSTATED])
def test_a_limited_range_is_refused_unless_the_rig_file_says_so(
    remote: RemoteCamera, scene: LevelScene, declared: dict[str, int]
) -> None:
    with served(remote, scene, **declared):
        with pytest.raises(DeviceError, match=f"{WHO}: its YUYV has limited range: .* white 235"):
            remote.ask("open", YUYV)
        remote.ask("open", replace(YUYV, limited_range=True))
        assert len(remote.grab(1)) == 1
        remote.ask("open", replace(YUYV, pixel_format="GREY"))  # counts of the sensor


@pytest.mark.parametrize(
    ("name", "colours", "quantization", "limited"),
    [
        ("YUYV", 8, 0, True),  # sRGB, range not stated
        ("YUYV", 1, 0, True),  # SMPTE 170M
        ("YUYV", 7, 0, False),  # JPEG
        ("YUYV", 8, 1, False),
        ("YUYV", 7, 2, True),
        ("GREY", 8, 2, False),
        ("Y16", 8, 0, False),
    ],
)
def test_the_range_of_luma_is_read_from_the_format(
    monkeypatch: pytest.MonkeyPatch, name: str, colours: int, quantization: int, limited: bool
) -> None:
    def answer(descriptor: int, request: int, memory: bytearray) -> None:
        assert (descriptor, request) == (5, ioctl.G_FMT)
        fields = (1, 64, 48, ioctl.fourcc(name), 1, 128, 6144, colours, 0xFEEDCAFE, 0, 0)
        memory[:] = ioctl.FORMAT_STRUCT.pack(*fields, quantization)

    monkeypatch.setattr("fcntl.ioctl", answer)
    assert ioctl.current_format(5).limited_range == limited


def test_a_full_range_is_refused_where_the_rig_file_says_limited(
    remote: RemoteCamera, scene: LevelScene
) -> None:
    with (
        served(remote, scene),
        pytest.raises(DeviceError, match=f"{WHO}: its YUYV has the full range, .* remove that"),
    ):
        remote.ask("open", replace(YUYV, limited_range=True))


def test_white_of_a_limited_range_is_235(remote: RemoteCamera, scene: LevelScene) -> None:
    scene.render = lambda exposure, _: np.full(  # type: ignore[method-assign]  # another picture
        (exposure.height_px, exposure.width_px), 255, np.uint8
    )
    with served(remote, scene, defects=CameraDefects(limited_range="declared")):
        remote.ask("open", replace(YUYV, limited_range=True))
        assert set(remote.grab(1)[0].image.ravel()) == {235}


def test_a_frame_rate_beyond_the_camera_is_refused(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene):
        remote.ask("open", replace(SETTINGS, frames_per_s=200))
        with pytest.raises(DeviceError, match="400 frames a second asked for, the camera took 200"):
            remote.ask("open", replace(SETTINGS, frames_per_s=400))


def test_a_camera_in_use_by_another_program(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        camera.streamer = "another program"
        with pytest.raises(DeviceError, match=f"{WHO}: .*whether another program uses the camera"):
            remote.ask("open", SETTINGS)


def test_a_missing_camera_is_reported_in_time(remote: RemoteCamera) -> None:
    start_s = time.monotonic()
    with pytest.raises(DeviceError, match=f"camera {DEVICE}: cannot be opened .*No such file"):
        remote.ask("open", SETTINGS)
    assert time.monotonic() - start_s < FOUND_WITHIN_S
