"""Emulated V4L2 camera for tests: device model here, OpenCV and driver in a child process.

The loader reads LD_PRELOAD when a process starts, so the driver runs in a child of its own. One
child serves a whole module; each test brings its own device model.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from shutil import which
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.v4l2.settings import V4l2Settings
from instrument.devices import Frame
from sim.emulated.v4l2.device import Capabilities, EmulatedCamera, Exposure
from sim.emulated.v4l2.server import V4l2Server
from sim.emulated.v4l2.shim import compile_shim, shim_environment
from tests.support.paths import ROOT
from tests.support.timing.deadline import DEADLINE_S, wait_for

DEVICE = "/dev/v4l/by-id/usb-emulated-camera"
WHO = re.escape(f"camera Emulated camera ({DEVICE})")
FOUND_WITHIN_S = 2.0  # beyond the exposure: a lost camera is reported
SETTINGS = V4l2Settings(
    device=DEVICE, pixel_format="Y16", width_px=64, height_px=48, bit_depth=16,
    min_exposure_s=0.001, max_exposure_s=2.0, gain=100,
)  # fmt: skip
QUICK = Capabilities(frames_per_s=200, overhead_s=0.001)


class RemoteCamera:
    """The child process, as a camera."""

    def __init__(self, folder: Path) -> None:
        self.socket = folder / "camera"
        ours, theirs = socket.socketpair()
        added = shim_environment(compile_shim(folder), DEVICE, self.socket)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.support.v4l2.child", str(theirs.fileno())],
            env=os.environ | added,
            cwd=ROOT,
            pass_fds=[theirs.fileno()],
        )
        theirs.close()
        self._pipe = Connection(ours.detach())

    def end(self) -> None:
        self._pipe.close()
        self._process.wait(DEADLINE_S)

    def begin(self, name: str, *arguments: object) -> None:
        """Ask without waiting; `answer` gives the result."""
        self._pipe.send((name, arguments))

    def answer(self) -> Any:
        if not self._pipe.poll(DEADLINE_S):
            raise TimeoutError(f"the child has not answered for {DEADLINE_S} s")
        result, error = self._pipe.recv()
        if error is not None:
            raise error
        return result

    def ask(self, name: str, *arguments: object) -> Any:
        self.begin(name, *arguments)
        return self.answer()

    def interrupt(self) -> None:
        """Send SIGINT, as Ctrl-C does."""
        self._process.send_signal(signal.SIGINT)

    def identity(self) -> str:
        return str(self.ask("identity"))

    def set_exposure_s(self, exposure_s: float) -> float:
        return float(self.ask("set_exposure_s", exposure_s))

    def grab(self, count: int) -> list[Frame]:
        frames: list[Frame] = self.ask("grab", count)
        return frames


class LevelScene:
    """Scene of the emulated camera: one level; the exposures taken are kept.

    The first row of each image holds level, exposure in 100 µs, gain and sequence number.
    """

    def __init__(self) -> None:
        self.level = 0
        self.exposed: list[Exposure] = []
        self.begun = 0  # exposures, including those whose frames nobody takes

    def snapshot(self) -> object:
        self.begun += 1
        return self.level

    def wait_exposures(self, count: int) -> None:
        """Wait until the sensor has begun `count` more exposures."""
        target = self.begun + count
        wait_for(lambda: self.begun >= target, f"{count} more exposures")

    def render(self, exposure: Exposure, seen: object) -> NDArray[Any]:
        self.exposed.append(exposure)
        image = np.zeros((exposure.height_px, exposure.width_px), np.uint16)
        steps = round(exposure.exposure_s * 10_000)
        assert isinstance(seen, int)
        image[0, :4] = seen, steps, exposure.gain, exposure.sequence % 65536
        return image

    def exposure_of(self, frame: Frame) -> Exposure:
        sequence = int(frame.image[0, 3])
        return next(e for e in reversed(self.exposed) if e.sequence % 65536 == sequence)


def level(frame: Frame) -> int:
    return int(frame.image[0, 0])


def steps(frame: Frame) -> int:
    """Exposure of the image, in 100 µs."""
    return int(frame.image[0, 1])


@contextmanager
def served(
    remote: RemoteCamera, scene: LevelScene, capabilities: Capabilities = QUICK, **changes: Any
) -> Iterator[EmulatedCamera]:
    """Run the device model; the child closes it at the end."""
    camera = EmulatedCamera(scene.render, scene.snapshot, replace(capabilities, **changes))
    with V4l2Server(camera, remote.socket):
        try:
            yield camera
        finally:
            remote.ask("close")


@contextmanager
def child(factory: pytest.TempPathFactory) -> Iterator[RemoteCamera]:
    """Start the child; skip what needs it where there is no compiler, as real cameras do not."""
    if which("cc") is None:
        pytest.skip(
            "no C compiler (Debian: gcc, libc6-dev): the emulated V4L2 camera cannot be built"
        )
    remote = RemoteCamera(factory.mktemp("v4l2"))
    try:
        yield remote
    finally:
        remote.end()
