"""Worker thread of the V4L2 camera: hung drivers and Ctrl-C."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from numpy.typing import NDArray

from instrument.errors import DeviceError
from sim.emulated.v4l2.device import Exposure
from tests.support.timing.deadline import wait_for
from tests.support.v4l2.remote_camera import (
    FOUND_WITHIN_S,
    SETTINGS,
    WHO,
    LevelScene,
    RemoteCamera,
    served,
)

pytestmark = pytest.mark.real_time


def test_a_hung_driver_blocks_nobody(remote: RemoteCamera, scene: LevelScene) -> None:
    """The device model answers no DQBUF any more; after a while it does again."""
    free = threading.Event()
    free.set()
    show = scene.render

    def render(exposure: Exposure, seen: object) -> NDArray[Any]:
        free.wait()
        return show(exposure, seen)

    scene.render = render  # type: ignore[method-assign]  # another picture
    with served(remote, scene):
        remote.ask("open", SETTINGS)
        remote.grab(1)
        free.clear()
        start_s = time.monotonic()
        with pytest.raises(DeviceError, match=f"{WHO}: its driver has not answered for .*cable"):
            remote.grab(1)
        assert time.monotonic() - start_s < 0.001 + FOUND_WITHIN_S
        with pytest.raises(DeviceError, match=f"{WHO}: its driver hangs;"):
            remote.grab(1)
        free.set()
        assert len(remote.grab(2)) == 2


def test_ctrl_c_ends_a_long_exposure_at_once(remote: RemoteCamera, scene: LevelScene) -> None:
    with served(remote, scene) as camera:
        remote.ask("open", SETTINGS)
        remote.set_exposure_s(2.0)
        taken = camera.requests["DQBUF"]
        remote.begin("grab", 1)
        wait_for(lambda: camera.requests["DQBUF"] > taken, "the first old frame")
        start_s = time.monotonic()
        remote.interrupt()
        with pytest.raises(KeyboardInterrupt):
            remote.answer()
        assert time.monotonic() - start_s < 1.0
        remote.set_exposure_s(0.001)
        remote.ask("close")
