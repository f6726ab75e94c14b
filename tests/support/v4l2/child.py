"""Child process started under LD_PRELOAD: drives a V4l2Camera by requests from a pipe.

Requests are (name, arguments); each public method of `Child` is one. The answer is (result, error).
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from datetime import UTC, datetime
from logging.handlers import MemoryHandler
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from drivers.v4l2 import listing
from drivers.v4l2.camera import V4l2Camera
from drivers.v4l2.capture import Capture
from drivers.v4l2.ioctl import BUFFER_DONE, buffer_state
from drivers.v4l2.open_device import buffer_count
from drivers.v4l2.settings import V4l2Settings
from drivers.v4l2.worker_thread import Heartbeat
from instrument.devices import Frame
from instrument.errors import DeviceError
from tests.support.timing.deadline import wait_for


class MonotonicClock:
    """Clock of a real rig."""

    def now_s(self) -> float:
        return time.monotonic()

    def utc(self) -> datetime:
        return datetime.now(UTC)

    def sleep(self, seconds: float) -> None:
        time.sleep(seconds)


class Child:
    def __init__(self) -> None:
        self.camera: V4l2Camera | None = None
        self.logged = MemoryHandler(10_000)
        logging.getLogger("drivers").addHandler(self.logged)

    def open(self, settings: V4l2Settings) -> str:
        self.close()
        self.camera = V4l2Camera(settings, MonotonicClock())
        return self.camera.identity()

    def open_blind(self, settings: V4l2Settings) -> str:
        """Open as if the descriptor that OpenCV streams on could not be identified."""
        with patch("drivers.v4l2.open_device._stream_descriptor", return_value=None):
            return self.open(settings)

    def open_late(self, settings: V4l2Settings) -> str:
        """Open with the buffers full again once the stream has been started: a busy computer."""
        start = Capture.start

        def late_start(capture: Capture, heartbeat: Heartbeat) -> None:
            start(capture, heartbeat)
            wait_for(lambda: _filled(capture) >= buffer_count(capture._video) - 1, "full buffers")

        with patch.object(Capture, "start", late_start):
            return self.open(settings)

    def ungated_grab(self, count: int) -> list[Frame]:
        """Frames as they come, without the filter."""
        assert self.camera is not None
        with patch("drivers.v4l2.frame_filter.FrameFilter.accepts", return_value=True):
            return self.camera.grab(count)

    def said(self) -> list[str]:
        """Messages logged by the driver since the last call."""
        texts = [record.getMessage() for record in self.logged.buffer]
        self.logged.buffer.clear()
        return texts

    def close(self) -> None:
        camera, self.camera = self.camera, None
        if camera is not None:
            camera.close()

    def closed_grab(self) -> str:
        """Error of a camera that was closed twice."""
        camera = self.camera
        assert camera is not None
        camera.close()
        camera.close()
        try:
            camera.grab(1)
        except DeviceError as error:
            return str(error)
        return ""

    def times_s(self, count: int) -> list[tuple[float, float | None]]:
        """Arrival time and time stamp of each frame; the images stay here."""
        assert self.camera is not None
        return [(frame.time_s, frame.device_time_s) for frame in self.camera.grab(count)]

    def held(self) -> tuple[int, int]:
        """Descriptors and threads of this process."""
        return len(list(Path("/proc/self/fd").iterdir())), threading.active_count()

    def describe(self, device: str) -> str:
        return listing.describe(device)

    def descriptions(self, *devices: str) -> list[str]:
        return listing.descriptions(devices)

    def found_cameras(self, *devices: str) -> list[listing.FoundCamera]:
        return listing.found_cameras(devices)

    def serve_here(self, settings: V4l2Settings, socket: str) -> list[tuple[int, float]]:
        """Device model and OpenCV in one process: counts and exposures of a few frames."""
        from sim.emulated.v4l2.device import EmulatedCamera, Exposure
        from sim.emulated.v4l2.server import V4l2Server

        def render(exposure: Exposure, seen: object) -> Any:
            shape = (exposure.height_px, exposure.width_px)
            return np.full(shape, round(exposure.exposure_s * 1e5), np.uint16)

        found = []
        with (
            V4l2Server(EmulatedCamera(render), Path(socket)),
            V4l2Camera(settings, MonotonicClock()) as camera,
        ):
            for exposure_s in (0.001, 0.02, 0.005):
                camera.set_exposure_s(exposure_s)
                found += [(int(f.image.max()), f.exposure_s) for f in camera.grab(3)]
        return found

    def answer(self, name: str, arguments: tuple[Any, ...]) -> Any:
        own = getattr(self, name, None)
        return (own or getattr(self.camera, name))(*arguments)


def _filled(capture: Capture) -> int:
    assert capture._stream is not None
    states = [buffer_state(capture._stream, n) for n in range(buffer_count(capture._video))]
    return sum(bool(state.flags & BUFFER_DONE) for state in states)


def main() -> None:
    child = Child()
    with Connection(int(sys.argv[1])) as pipe:
        while True:
            try:
                name, arguments = pipe.recv()
            except EOFError:
                child.close()
                return
            try:
                pipe.send((child.answer(name, arguments), None))
            except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 - the test process raises it
                pipe.send((None, error))


if __name__ == "__main__":
    main()
