"""One opening's stream of an emulated camera: buffers, and a sensor that runs freely."""

from __future__ import annotations

import errno
import mmap
import os
import threading
import time
from collections import deque
from dataclasses import dataclass

from drivers.v4l2 import ioctl as v4l2
from sim.emulated.v4l2.device import EmulatedCamera, Exposure, Refused

MOST_BUFFERS = 32
_MONOTONIC = 0x2000  # V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC; the stamp is of the end of the frame


@dataclass(slots=True)
class Slot:
    """One buffer. Only a filled one that nobody has taken yet says that it is bad, as in Linux."""

    state: int = 0  # BUFFER_QUEUED, BUFFER_DONE, or 0: with the application
    bytes_used: int = 0
    time_s: float = 0.0
    sequence: int = 0
    bad: bool = False
    taken: tuple[Exposure, object] | None = None


class Stream:
    """Buffers between sensor and application. `ready` counts the filled ones."""

    def __init__(self, camera: EmulatedCamera) -> None:
        self._camera = camera
        self.ready = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK | os.EFD_SEMAPHORE)
        self.memory = os.memfd_create("frames", os.MFD_CLOEXEC)
        self._map: mmap.mmap | None = None
        self._slots: list[Slot] = []
        self._queued: deque[int] = deque()
        self._done: deque[int] = deque()
        self._length = 0
        self._sensor: threading.Thread | None = None
        self._change = threading.Condition()
        self._closed = False
        camera.watch_unplug(self._wake, True)

    def close(self) -> None:
        """The application has closed its descriptor."""
        self._camera.watch_unplug(self._wake, False)
        self.stop()
        if self._camera.streamer is self:
            self._camera.streamer = None
        self._map = None
        with self._change:
            self._closed = True
            os.close(self.ready)
            os.close(self.memory)

    def _wake(self) -> None:
        with self._change:
            if not self._closed:
                os.eventfd_write(self.ready, 1)
            self._change.notify_all()

    @property
    def streaming(self) -> bool:
        """Whether the sensor runs."""
        return self._sensor is not None

    # What the application asks for

    def request_buffers(self, count: int) -> int:
        """Set up `count` buffers, or give them all back (0)."""
        if self.streaming or self._camera.streamer not in (None, self):
            raise Refused(errno.EBUSY)
        if self._camera.faults.gives_no_buffers and count:
            raise Refused(errno.ENOMEM)
        count = min(count, MOST_BUFFERS)
        self._camera.streamer = self if count else None
        page = mmap.PAGESIZE
        self._length = -(-self._camera.format().bytes_total // page) * page
        self._slots = [Slot() for _ in range(count)]
        self._map = None
        os.ftruncate(self.memory, count * self._length)
        if count:
            self._map = mmap.mmap(self.memory, count * self._length)
        return count

    def query(self, index: int) -> bytes:
        """The state of a buffer, as bytes of the structure."""
        with self._change:
            if not self._camera.description.tells_filled:
                return self._packed_as(index, Slot())
            return self._packed(index)

    def queue(self, index: int) -> bytes:
        """Take an empty buffer from the application."""
        with self._change:
            slot = self._slot(index)
            if slot.state:
                raise Refused(errno.EINVAL)
            self._slots[index] = Slot(state=v4l2.BUFFER_QUEUED)
            self._queued.append(index)
            return self._packed(index)

    def dequeue(self) -> bytes:
        """Hand the filled buffer that waits longest to the application, rendered now."""
        with self._change:
            if not self.streaming:
                raise Refused(errno.EINVAL)
            if not self._done:
                raise Refused(errno.EAGAIN)
            index = self._done.popleft()
            os.eventfd_read(self.ready)
            answer = self._packed(index)
            slot = self._slots[index]
            slot.state = 0
        self._expose(index, slot)
        return answer

    def _expose(self, index: int, slot: Slot) -> None:
        if slot.taken is None or self._map is None:
            return
        picture = self._camera.picture(*slot.taken)[: slot.bytes_used]
        self._map[index * self._length : index * self._length + picture.size] = picture.data

    def start(self) -> None:
        """Let the sensor run."""
        if not self._slots:
            raise Refused(errno.EINVAL)
        if not self.streaming:
            self._sensor = threading.Thread(target=self._run, daemon=True, name="emulated sensor")
            self._sensor.start()

    def stop(self) -> None:
        """Stop the sensor; all buffers are the application's."""
        sensor, self._sensor = self._sensor, None
        with self._change:
            self._change.notify_all()
        if sensor is not None:
            sensor.join()
        with self._change:
            self._queued.clear()
            self._slots = [Slot() for _ in self._slots]
            while self._done:
                self._done.popleft()
                os.eventfd_read(self.ready)

    def _slot(self, index: int) -> Slot:
        if not 0 <= index < len(self._slots):
            raise Refused(errno.EINVAL)
        return self._slots[index]

    def _packed(self, index: int) -> bytes:
        return self._packed_as(index, self._slot(index))

    def _packed_as(self, index: int, slot: Slot) -> bytes:
        self._slot(index)
        flags = _MONOTONIC | slot.state
        if slot.state == v4l2.BUFFER_DONE and slot.bad:
            flags |= v4l2.BUFFER_ERROR
        seconds, microseconds = divmod(int(slot.time_s * 1e6), 1_000_000)
        stamp = (seconds, microseconds, slot.sequence)
        where = (v4l2.MMAP, index * self._length, self._length)
        return v4l2.BUFFER_STRUCT.pack(
            index, v4l2.CAPTURE, slot.bytes_used, flags, 1, *stamp, *where
        )

    # The sensor

    def _run(self) -> None:
        camera, able = self._camera, self._camera.description
        pipeline = deque([camera.exposure_s] * able.delay_frames)
        due_s = time.monotonic()
        sequence = 0
        while self._waited_until(due_s):
            pipeline.append(camera.exposure_s)
            exposure = self._begin(pipeline.popleft(), sequence)
            seen = camera.snapshot()
            end_s = max(due_s, exposure.start_s) + exposure.exposure_s + able.overhead_s
            if not self._waited_until(end_s):
                return
            self._end(exposure, seen, end_s)
            due_s += max(exposure.exposure_s + able.overhead_s, 1 / able.frames_per_s)
            if due_s < time.monotonic() - 1 / able.frames_per_s:
                due_s = time.monotonic()  # this machine could not keep up
            sequence += 1

    def _begin(self, exposure_s: float, sequence: int) -> Exposure:
        camera = self._camera
        return Exposure(
            exposure_s, camera.gain, time.monotonic(), sequence, camera.pixel_format, *camera.size
        )

    def _end(self, exposure: Exposure, seen: object, end_s: float) -> None:
        """Read out: into the buffer that waits longest; a frame without a buffer is lost."""
        faults = self._camera.faults
        with self._change:
            if not self._queued or faults.frozen or faults.unplugged or not self.streaming:
                return
            index = self._queued.popleft()
            slot = self._slots[index]
            slot.state = v4l2.BUFFER_DONE
            slot.bytes_used = self._camera.format().bytes_total
            slot.time_s = end_s + self._camera.description.stamp_offset_s
            slot.sequence, slot.taken = exposure.sequence, (exposure, seen)
            spoilt = faults.spoilt.popleft() if faults.spoilt else None
            slot.bad = spoilt == "flagged"
            if spoilt == "short":
                slot.bytes_used //= 2
            self._done.append(index)
            os.eventfd_write(self.ready, 1)

    def _waited_until(self, moment_s: float) -> bool:
        """Wait for a moment; False when the stream was stopped meanwhile."""
        with self._change:
            while self.streaming:
                left_s = moment_s - time.monotonic()
                if left_s <= 0:
                    return True
                self._change.wait(left_s)
        return False
