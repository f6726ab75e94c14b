"""Video stream of one open descriptor: its buffers, which a free-running sensor fills.

Frames are numbered as by uvcvideo and vivid of Linux: from 0 at each start of the stream, also
those for which no buffer was free, so that a lost frame is a gap.
"""

from __future__ import annotations

import errno
import mmap
import os
import threading
from collections import deque
from dataclasses import dataclass

from drivers.v4l2 import ioctl
from sim.emulated.v4l2.device import EmulatedCamera, Exposure, Refused
from sim.emulated.v4l2.sensor import FreeRunningSensor

_MAX_BUFFERS = 32
_MONOTONIC = 0x2000  # V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC, taken at the end of the frame


@dataclass(slots=True)
class _Buffer:
    """One buffer. As in Linux, `bad` is reported only while it is filled and not yet dequeued.

    `frame`: exposure and snapshot, rendered when the buffer is dequeued.
    """

    state: int = 0  # BUFFER_QUEUED, BUFFER_DONE, or 0: owned by the application
    bytes_used: int = 0
    time_s: float = 0.0
    sequence: int = 0
    bad: bool = False
    frame: tuple[Exposure, object] | None = None


class Stream:
    """Buffers between sensor and application.

    `ready`: eventfd that counts the filled buffers; `memory`: memory file that holds the buffers.
    """

    def __init__(self, camera: EmulatedCamera) -> None:
        self._camera = camera
        self.ready = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK | os.EFD_SEMAPHORE)
        self.memory = os.memfd_create("frames", os.MFD_CLOEXEC)
        self._map: mmap.mmap | None = None
        self._buffers: list[_Buffer] = []
        self._queued: deque[int] = deque()
        self._done: deque[int] = deque()
        self._length = 0
        self._last: tuple[Exposure, object] | None = None
        self._sensor = FreeRunningSensor(camera, self._read_out)
        self._lock = threading.Lock()
        self._closed = False
        camera.watch_unplug(self._wake, True)

    def close(self) -> None:
        """Release everything after the application has closed its descriptor."""
        self._camera.watch_unplug(self._wake, False)
        self.stop()
        if self._camera.streamer is self:
            self._camera.streamer = None
        self._map = None
        with self._lock:
            self._closed = True
            os.close(self.ready)
            os.close(self.memory)

    def _wake(self) -> None:
        with self._lock:
            if not self._closed:
                os.eventfd_write(self.ready, 1)

    @property
    def streaming(self) -> bool:
        """True while the sensor runs."""
        return self._sensor.running

    # Requests of the application

    def request_buffers(self, count: int) -> int:
        """Allocate `count` buffers (0 frees all) and return the number allocated."""
        if self.streaming or self._camera.streamer not in (None, self):
            raise Refused(errno.EBUSY)
        if self._camera.faults.gives_no_buffers and count:
            raise Refused(errno.ENOMEM)
        count = min(count, _MAX_BUFFERS)
        self._camera.streamer = self if count else None
        page = mmap.PAGESIZE
        self._length = -(-self._camera.format().bytes_total // page) * page
        self._buffers = [_Buffer() for _ in range(count)]
        self._map = None
        os.ftruncate(self.memory, count * self._length)
        if count:
            self._map = mmap.mmap(self.memory, count * self._length)
        return count

    def query(self, index: int) -> bytes:
        """Return the state of a buffer as bytes of `struct v4l2_buffer`."""
        with self._lock:
            buffer = self._buffer(index)
            visible = self._camera.capabilities.reports_filled
            return self._pack(index, buffer if visible else _Buffer())

    def queue(self, index: int) -> bytes:
        """Take an empty buffer back from the application; return its state."""
        with self._lock:
            if self._buffer(index).state:
                raise Refused(errno.EINVAL)
            buffer = self._buffers[index] = _Buffer(state=ioctl.BUFFER_QUEUED)
            self._queued.append(index)
            return self._pack(index, buffer)

    def dequeue(self) -> bytes:
        """Render the oldest filled buffer, hand it to the application and return its state."""
        with self._lock:
            if not self.streaming:
                raise Refused(errno.EINVAL)
            if not self._done:
                raise Refused(errno.EAGAIN)
            index = self._done.popleft()
            os.eventfd_read(self.ready)
            buffer = self._buffers[index]
            answer = self._pack(index, buffer)
            buffer.state = 0
        self._render(index, buffer)
        return answer

    def _render(self, index: int, buffer: _Buffer) -> None:
        if buffer.frame is None or self._map is None:
            return
        data = self._camera.frame_bytes(*buffer.frame)[: buffer.bytes_used]
        self._map[index * self._length : index * self._length + data.size] = data.data

    def start(self) -> None:
        """Start the sensor."""
        if not self._buffers:
            raise Refused(errno.EINVAL)
        self._sensor.start()

    def stop(self) -> None:
        """Stop the sensor and return all buffers to the application."""
        self._sensor.stop()
        with self._lock:
            self._queued.clear()
            self._buffers = [_Buffer() for _ in self._buffers]
            while self._done:
                self._done.popleft()
                os.eventfd_read(self.ready)

    def _buffer(self, index: int) -> _Buffer:
        if not 0 <= index < len(self._buffers):
            raise Refused(errno.EINVAL)
        return self._buffers[index]

    def _pack(self, index: int, buffer: _Buffer) -> bytes:
        flags = _MONOTONIC | buffer.state
        if buffer.state == ioctl.BUFFER_DONE and buffer.bad:
            flags |= ioctl.BUFFER_ERROR
        seconds, microseconds = divmod(int(buffer.time_s * 1e6), 1_000_000)
        stamp = (seconds, microseconds, buffer.sequence)
        location = (ioctl.MMAP, index * self._length, self._length)
        return ioctl.BUFFER_STRUCT.pack(
            index, ioctl.CAPTURE, buffer.bytes_used, flags, 1, *stamp, *location
        )

    # The sensor

    def _read_out(self, exposure: Exposure, snapshot: object, end_s: float) -> None:
        """Read the frame into the oldest queued buffer; without one the frame is lost."""
        faults = self._camera.faults
        with self._lock:
            if not self._queued or faults.frozen or faults.unplugged or not self.streaming:
                return
            index = self._queued.popleft()
            buffer = self._buffers[index]
            buffer.state = ioctl.BUFFER_DONE
            buffer.bytes_used = self._camera.format().bytes_total
            buffer.time_s = end_s + self._camera.capabilities.stamp_offset_s
            if not (faults.repeats and self._last):
                self._last = (exposure, snapshot)
            buffer.sequence, buffer.frame = self._last[0].sequence, self._last
            bad = faults.bad_frames.popleft() if faults.bad_frames else None
            buffer.bad = bad == "flagged"
            if bad == "short":
                buffer.bytes_used //= 2
            self._done.append(index)
            os.eventfd_write(self.ready, 1)
