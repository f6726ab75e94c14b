"""Socket server of an emulated camera: answers the requests of each open descriptor in a thread."""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from struct import Struct

from drivers.v4l2 import ioctl
from instrument.closeable import Closeable
from sim.emulated.v4l2.device import EmulatedCamera, Refused
from sim.emulated.v4l2.stream import Stream

_REQUEST, _ERROR = Struct("<II"), Struct("<i")
_MAX_BYTES = 1024
_STREAMING = 0x04200000  # V4L2_CAP_EXT_PIX_FORMAT, _STREAMING
_BIG_ENDIAN = 1 << 31  # of a pixel format
_PROGRESSIVE, _SRGB = 1, 8  # V4L2_FIELD_NONE, V4L2_COLORSPACE_SRGB
_EXTENDED = 0xFEEDCAFE  # V4L2_PIX_FMT_PRIV_MAGIC
_TIME_PER_FRAME = 0x1000  # V4L2_CAP_TIMEPERFRAME
_NEXT = 0x80000000
_VOLATILE = 0x80  # V4L2_CTRL_FLAG_VOLATILE
_KIND_NUMBERS = {name: number for number, name in reversed(ioctl.KINDS.items())}


class V4l2Server(Closeable):
    """Server of one emulated camera on a socket, for any number of open descriptors."""

    def __init__(self, camera: EmulatedCamera, path: Path) -> None:
        self._camera, self._path = camera, path
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(path))
        self._listener.listen()
        self._connections: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._accept, daemon=True, name="emulated camera")
        self._thread.start()

    def close(self) -> None:
        """Stop serving; on descriptors still open the camera has disappeared."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        self._path.unlink(missing_ok=True)
        with self._lock:
            for connection in self._connections:
                connection.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return  # closed
            with self._lock:
                self._connections.add(connection)
            threading.Thread(
                target=self._serve, args=(connection,), daemon=True, name="emulated descriptor"
            ).start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            self._camera.admit("open")
            _Descriptor(self._camera, connection).serve()
        except Refused as refusal:
            connection.send(_ERROR.pack(refusal.number))
        except (BrokenPipeError, ConnectionResetError):
            pass  # the application has ended
        finally:
            with self._lock:
                self._connections.discard(connection)
                connection.close()


class _Descriptor:
    """One open descriptor of the application."""

    def __init__(self, camera: EmulatedCamera, connection: socket.socket) -> None:
        self._camera, self._connection = camera, connection
        self._stream = Stream(camera)
        self._times_unplugged = camera.times_unplugged
        self._handlers: dict[int, tuple[str, Callable[[bytes], bytes]]] = {
            ioctl.QUERYCAP: ("QUERYCAP", self._capability),
            ioctl.ENUM_FMT: ("ENUM_FMT", self._list_format),
            ioctl.ENUM_FRAMESIZES: ("ENUM_FRAMESIZES", self._list_size),
            ioctl.G_FMT: ("G_FMT", self._format),
            ioctl.S_FMT: ("S_FMT", self._set_format),
            ioctl.TRY_FMT: ("TRY_FMT", lambda a: self._pack(self._nearest_format(a))),
            ioctl.REQBUFS: ("REQBUFS", self._request_buffers),
            ioctl.QUERYBUF: ("QUERYBUF", lambda a: self._stream.query(_buffer_index(a))),
            ioctl.QBUF: ("QBUF", lambda a: self._stream.queue(_buffer_index(a))),
            ioctl.DQBUF: ("DQBUF", lambda _: self._stream.dequeue()),
            ioctl.STREAMON: ("STREAMON", self._start),
            ioctl.STREAMOFF: ("STREAMOFF", self._stop),
            ioctl.G_PARM: ("G_PARM", self._rate),
            ioctl.S_PARM: ("S_PARM", self._rate),
            ioctl.G_CTRL: ("G_CTRL", self._control),
            ioctl.S_CTRL: ("S_CTRL", self._set_control),
            ioctl.QUERYCTRL: ("QUERYCTRL", self._query_control),
            ioctl.G_INPUT: ("G_INPUT", lambda _: bytes(4)),
            ioctl.S_INPUT: ("S_INPUT", self._set_input),
        }

    def serve(self) -> None:
        """Answer requests until the application closes the descriptor."""
        descriptors = [self._stream.ready, self._stream.memory]
        try:
            socket.send_fds(self._connection, [_ERROR.pack(0)], descriptors)
            while message := self._connection.recv(_MAX_BYTES):
                self._connection.send(self._answer(message))
        finally:
            self._stream.close()

    def _answer(self, message: bytes) -> bytes:
        request, size = _REQUEST.unpack_from(message)
        argument = message[_REQUEST.size :]
        try:
            name, handle = self._handlers.get(request, (hex(request), _refuse))
            _require(self._times_unplugged == self._camera.times_unplugged, errno.ENODEV)
            self._camera.admit(name)
            return _ERROR.pack(0) + handle(argument).ljust(size, b"\0")
        except Refused as refusal:
            return _ERROR.pack(refusal.number) + argument

    def _capability(self, _: bytes) -> bytes:
        own = self._camera.capabilities
        # As uvcvideo answers: the whole device has pictures and metadata, each node has one.
        whole = ioctl.STATES_NODE | ioctl.VIDEO_CAPTURE | ioctl.METADATA | _STREAMING
        return ioctl.CAPABILITY_STRUCT.pack(
            b"emulated",
            own.card.encode(),
            b"platform:emulated-0",
            6 << 16,
            whole,
            own.node | _STREAMING,
        )

    def _list_format(self, argument: bytes) -> bytes:
        index, kind, *_ = ioctl.FMTDESC_STRUCT.unpack(argument)
        formats = self._camera.capabilities.formats
        _require(kind == ioctl.CAPTURE and index < len(formats) and self._for_pictures)
        name = formats[index]
        number = ioctl.fourcc(name) | _BIG_ENDIAN * self._camera.capabilities.big_endian
        return ioctl.FMTDESC_STRUCT.pack(index, kind, 0, name.encode(), number)

    @property
    def _for_pictures(self) -> bool:
        return self._camera.capabilities.node == ioctl.VIDEO_CAPTURE

    def _list_size(self, argument: bytes) -> bytes:
        index, number, *_ = ioctl.FRAMESIZE_STRUCT.unpack(argument)
        sizes = self._camera.capabilities.sizes
        _require(index < len(sizes))
        return ioctl.FRAMESIZE_STRUCT.pack(index, number, ioctl.DISCRETE, *sizes[index], *[0] * 4)

    def _format(self, argument: bytes) -> bytes:
        _require(argument[:4] == ioctl.CAPTURE.to_bytes(4, "little") and self._for_pictures)
        return self._pack(self._camera.format())

    def _set_format(self, argument: bytes) -> bytes:
        chosen = self._nearest_format(argument)
        _require(self._camera.streamer is None, errno.EBUSY)
        self._camera.set_format(chosen)
        return self._pack(chosen)

    def _nearest_format(self, argument: bytes) -> ioctl.Format:
        kind, width, height, number, *_ = ioctl.FORMAT_STRUCT.unpack(argument)
        _require(kind == ioctl.CAPTURE and self._for_pictures)
        return self._camera.nearest_format(ioctl.fourcc_name(number), width, height)

    def _pack(self, chosen: ioctl.Format) -> bytes:
        return ioctl.FORMAT_STRUCT.pack(
            ioctl.CAPTURE,
            chosen.width_px,
            chosen.height_px,
            ioctl.fourcc(chosen.name),
            _PROGRESSIVE,
            chosen.bytes_per_line,
            chosen.bytes_total,
            _SRGB,
            _EXTENDED,
            0,
            0,
            self._camera.quantization,
        )

    def _request_buffers(self, argument: bytes) -> bytes:
        count, kind, memory, _ = ioctl.REQBUFS_STRUCT.unpack(argument)
        _require(kind == ioctl.CAPTURE and memory == ioctl.MMAP)
        granted = self._stream.request_buffers(count)
        return ioctl.REQBUFS_STRUCT.pack(granted, kind, memory, 1)

    def _start(self, argument: bytes) -> bytes:
        self._stream.start()
        return argument

    def _stop(self, argument: bytes) -> bytes:
        self._stream.stop()
        return argument

    def _rate(self, _: bytes) -> bytes:
        """Return the only frame rate, whatever was requested."""
        frames_per_s = self._camera.capabilities.frames_per_s
        return ioctl.PARM_STRUCT.pack(ioctl.CAPTURE, _TIME_PER_FRAME, 0, 1, frames_per_s)

    def _control(self, argument: bytes) -> bytes:
        number, _ = ioctl.CONTROL_STRUCT.unpack(argument)
        return ioctl.CONTROL_STRUCT.pack(number, self._camera.value(number))

    def _set_control(self, argument: bytes) -> bytes:
        number, value = ioctl.CONTROL_STRUCT.unpack(argument)
        return ioctl.CONTROL_STRUCT.pack(number, self._camera.set_value(number, value))

    def _query_control(self, argument: bytes) -> bytes:
        number = ioctl.QUERYCTRL_STRUCT.unpack(argument)[0]
        controls = self._camera.controls()
        if number & _NEXT:
            number = min((n for n in controls if n > number & ~_NEXT), default=0)
        _require(number in controls)
        control = controls[number]
        limits = (control.minimum, control.maximum, control.step, control.default)
        kind = _KIND_NUMBERS[control.kind]
        flags = 0 if control.steady else _VOLATILE
        return ioctl.QUERYCTRL_STRUCT.pack(number, kind, control.name.encode(), *limits, flags)

    def _set_input(self, argument: bytes) -> bytes:
        _require(argument == bytes(4))
        return argument


def _require(condition: bool, error: int = errno.EINVAL) -> None:
    if not condition:
        raise Refused(error)


def _refuse(_: bytes) -> bytes:
    raise Refused(errno.ENOTTY)


def _buffer_index(argument: bytes) -> int:
    index, kind, *_ = ioctl.BUFFER_STRUCT.unpack(argument)
    _require(kind == ioctl.CAPTURE)
    return int(index)
