"""Free-running sensor of an emulated camera: exposes frame after frame in a thread of its own."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from sim.emulated.v4l2.device import EmulatedCamera, Exposure

ReadOut = Callable[[Exposure, object, float], None]


class FreeRunningSensor:
    """Sensor that exposes with the camera's present settings until it is stopped.

    `read_out(exposure, snapshot, end_s)` is called at the end of each frame, `end_s` on the
    monotonic clock; the next exposure begins after it has returned. `stop` calls `interrupt`, which
    ends a read-out that waits.
    """

    def __init__(
        self,
        camera: EmulatedCamera,
        read_out: ReadOut,
        interrupt: Callable[[], None] = lambda: None,
    ) -> None:
        self._camera, self._read_out, self._interrupt = camera, read_out, interrupt
        self._thread: threading.Thread | None = None
        self._stopping = threading.Event()

    @property
    def running(self) -> bool:
        """True from `start` until `stop`."""
        return self._thread is not None and not self._stopping.is_set()

    def start(self) -> None:
        """Begin to expose, unless the sensor runs already."""
        if self._thread is None:
            self._stopping.clear()
            self._thread = threading.Thread(target=self._run, daemon=True, name="emulated sensor")
            self._thread.start()

    def stop(self) -> None:
        """End the present exposure; no frame is read out after that."""
        thread = self._thread
        self._stopping.set()
        self._interrupt()
        if thread is not None:
            thread.join()
            self._thread = None

    def _run(self) -> None:
        camera = self._camera
        pipeline = deque([camera.exposure_s] * camera.capabilities.delay_frames)
        due_s = time.monotonic()
        sequence = 0
        while self._wait_until(due_s):
            pipeline.append(camera.exposure_s)
            exposure = self._begin_exposure(pipeline.popleft(), sequence)
            snapshot = camera.snapshot()
            occupied_s = exposure.exposure_s + camera.capabilities.overhead_s
            end_s = max(due_s, exposure.start_s) + occupied_s
            if not self._wait_until(end_s):
                return
            self._read_out(exposure, snapshot, end_s)
            due_s += max(occupied_s, camera.frame_interval_s)
            if due_s < time.monotonic() - camera.frame_interval_s:
                due_s = time.monotonic()  # the machine could not keep up
            sequence += 1

    def _begin_exposure(self, exposure_s: float, sequence: int) -> Exposure:
        camera = self._camera
        return Exposure(
            exposure_s, camera.gain, time.monotonic(), sequence, camera.pixel_format, *camera.size
        )

    def _wait_until(self, until_s: float) -> bool:
        """Wait until a time; return False if the sensor was stopped meanwhile."""
        left_s = until_s - time.monotonic()
        return not (self._stopping.wait(left_s) if left_s > 0 else self._stopping.is_set())
