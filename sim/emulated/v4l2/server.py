"""The emulated camera's end of the socket: requests in, answers out, a thread for each opening."""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from struct import Struct

from drivers.v4l2 import ioctl as v4l2
from instrument.closeable import Closing
from sim.emulated.v4l2.device import EmulatedCamera, Refused
from sim.emulated.v4l2.stream import Stream

_QUESTION, _ERROR = Struct("<II"), Struct("<i")
_MOST_BYTES = 1024
_CAPTURE_AND_STREAMING = 0x04200001  # V4L2_CAP_VIDEO_CAPTURE, _EXT_PIX_FORMAT, _STREAMING
_DEVICE_CAPS = 0x80000000
_TIME_PER_FRAME = 0x1000  # V4L2_CAP_TIMEPERFRAME
_NEXT = 0x80000000
_KIND_NUMBERS = {name: number for number, name in reversed(v4l2.KINDS.items())}


class V4l2Server(Closing):
    """Serves one emulated camera on a socket, for any number of openings, while it is open."""

    def __init__(self, camera: EmulatedCamera, path: Path) -> None:
        self._camera, self._path = camera, path
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listener.bind(str(path))
        self._listener.listen()
        self._openings: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._accept, daemon=True, name="emulated camera")
        self._thread.start()

    def close(self) -> None:
        """Stop serving: to whoever has the camera open it is gone."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._listener.close()
        self._path.unlink(missing_ok=True)
        with self._lock:
            for opening in self._openings:
                opening.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return  # closed
            with self._lock:
                self._openings.add(connection)
            threading.Thread(
                target=self._serve, args=(connection,), daemon=True, name="emulated opening"
            ).start()

    def _serve(self, connection: socket.socket) -> None:
        try:
            self._camera.admit("open")
            _Opening(self._camera, connection).serve()
        except Refused as refusal:
            connection.send(_ERROR.pack(refusal.number))
        except (BrokenPipeError, ConnectionResetError):
            pass  # the other end is gone: nobody is left to tell
        finally:
            with self._lock:
                self._openings.discard(connection)
                connection.close()


class _Opening:
    """One descriptor of an application."""

    def __init__(self, camera: EmulatedCamera, connection: socket.socket) -> None:
        self._camera, self._connection = camera, connection
        self._stream = Stream(camera)
        self._plugged = camera.times_unplugged
        self._answers: dict[int, tuple[str, Callable[[bytes], bytes]]] = {
            v4l2.QUERYCAP: ("QUERYCAP", self._capability),
            v4l2.ENUM_FMT: ("ENUM_FMT", self._list_format),
            v4l2.ENUM_FRAMESIZES: ("ENUM_FRAMESIZES", self._list_size),
            v4l2.G_FMT: ("G_FMT", self._format),
            v4l2.S_FMT: ("S_FMT", self._set_format),
            v4l2.TRY_FMT: ("TRY_FMT", self._try_format),
            v4l2.REQBUFS: ("REQBUFS", self._request_buffers),
            v4l2.QUERYBUF: ("QUERYBUF", self._query_buffer),
            v4l2.QBUF: ("QBUF", self._queue),
            v4l2.DQBUF: ("DQBUF", lambda _: self._stream.dequeue()),
            v4l2.STREAMON: ("STREAMON", self._start),
            v4l2.STREAMOFF: ("STREAMOFF", self._stop),
            v4l2.G_PARM: ("G_PARM", self._rate),
            v4l2.S_PARM: ("S_PARM", self._rate),
            v4l2.G_CTRL: ("G_CTRL", self._control),
            v4l2.S_CTRL: ("S_CTRL", self._set_control),
            v4l2.QUERYCTRL: ("QUERYCTRL", self._query_control),
            v4l2.G_INPUT: ("G_INPUT", lambda _: bytes(4)),
            v4l2.S_INPUT: ("S_INPUT", self._set_input),
        }

    def serve(self) -> None:
        """Answer until the application closes its descriptor."""
        descriptors = [self._stream.ready, self._stream.memory]
        try:
            socket.send_fds(self._connection, [_ERROR.pack(0)], descriptors)
            while question := self._connection.recv(_MOST_BYTES):
                self._connection.send(self._answer(question))
        finally:
            self._stream.close()

    def _answer(self, question: bytes) -> bytes:
        request, size = _QUESTION.unpack_from(question)
        argument = question[_QUESTION.size :]
        try:
            name, answer = self._answers.get(request, (hex(request), _unknown))
            _require(self._plugged == self._camera.times_unplugged, errno.ENODEV)
            self._camera.admit(name)
            return _ERROR.pack(0) + answer(argument).ljust(size, b"\0")
        except Refused as refusal:
            return _ERROR.pack(refusal.number) + argument

    def _capability(self, _: bytes) -> bytes:
        card = self._camera.description.card.encode()
        able = (_DEVICE_CAPS | _CAPTURE_AND_STREAMING, _CAPTURE_AND_STREAMING)
        return v4l2.CAPABILITY_STRUCT.pack(
            b"emulated", card, b"platform:emulated-0", 6 << 16, *able
        )

    def _list_format(self, argument: bytes) -> bytes:
        index, kind, *_ = v4l2.FMTDESC_STRUCT.unpack(argument)
        formats = self._camera.description.formats
        _require(kind == v4l2.CAPTURE and index < len(formats))
        name = formats[index]
        return v4l2.FMTDESC_STRUCT.pack(index, kind, 0, name.encode(), v4l2.fourcc(name))

    def _list_size(self, argument: bytes) -> bytes:
        index, number, *_ = v4l2.FRAMESIZE_STRUCT.unpack(argument)
        sizes = self._camera.description.sizes
        _require(index < len(sizes))
        return v4l2.FRAMESIZE_STRUCT.pack(index, number, v4l2.DISCRETE, *sizes[index], *[0] * 4)

    def _format(self, argument: bytes) -> bytes:
        _require(argument[:4] == v4l2.CAPTURE.to_bytes(4, "little"))
        return _packed(self._camera.format())

    def _try_format(self, argument: bytes) -> bytes:
        return _packed(self._wanted(argument))

    def _set_format(self, argument: bytes) -> bytes:
        wanted = self._wanted(argument)
        _require(self._camera.streamer is None, errno.EBUSY)
        self._camera.take_format(wanted)
        return _packed(wanted)

    def _wanted(self, argument: bytes) -> v4l2.Format:
        kind, width, height, number, *_ = v4l2.FORMAT_STRUCT.unpack(argument)
        _require(kind == v4l2.CAPTURE)
        return self._camera.nearest(v4l2.fourcc_name(number), width, height)

    def _request_buffers(self, argument: bytes) -> bytes:
        count, kind, memory, _ = v4l2.REQBUFS_STRUCT.unpack(argument)
        _require(kind == v4l2.CAPTURE and memory == v4l2.MMAP)
        given = self._stream.request_buffers(count)
        return v4l2.REQBUFS_STRUCT.pack(given, kind, memory, 1)

    def _query_buffer(self, argument: bytes) -> bytes:
        return self._stream.query(_buffer_index(argument))

    def _queue(self, argument: bytes) -> bytes:
        return self._stream.queue(_buffer_index(argument))

    def _start(self, argument: bytes) -> bytes:
        self._stream.start()
        return argument

    def _stop(self, argument: bytes) -> bytes:
        self._stream.stop()
        return argument

    def _rate(self, _: bytes) -> bytes:
        """The camera has one rate, whatever is asked for."""
        frames_per_s = self._camera.description.frames_per_s
        return v4l2.PARM_STRUCT.pack(v4l2.CAPTURE, _TIME_PER_FRAME, 0, 1, frames_per_s)

    def _control(self, argument: bytes) -> bytes:
        number, _ = v4l2.CONTROL_STRUCT.unpack(argument)
        return v4l2.CONTROL_STRUCT.pack(number, self._camera.value(number))

    def _set_control(self, argument: bytes) -> bytes:
        number, value = v4l2.CONTROL_STRUCT.unpack(argument)
        return v4l2.CONTROL_STRUCT.pack(number, self._camera.set_value(number, value))

    def _query_control(self, argument: bytes) -> bytes:
        number = v4l2.QUERYCTRL_STRUCT.unpack(argument)[0]
        controls = self._camera.controls(current=False)
        if number & _NEXT:
            number = min((n for n in controls if n > number & ~_NEXT), default=0)
        _require(number in controls)
        one = controls[number]
        limits = (one.least, one.greatest, one.step, one.default)
        kind = _KIND_NUMBERS[one.kind]
        return v4l2.QUERYCTRL_STRUCT.pack(number, kind, one.name.encode(), *limits, 0)

    def _set_input(self, argument: bytes) -> bytes:
        _require(argument == bytes(4))
        return argument


def _require(condition: bool, otherwise: int = errno.EINVAL) -> None:
    if not condition:
        raise Refused(otherwise)


def _unknown(_: bytes) -> bytes:
    raise Refused(errno.ENOTTY)


def _buffer_index(argument: bytes) -> int:
    index, kind, *_ = v4l2.BUFFER_STRUCT.unpack(argument)
    _require(kind == v4l2.CAPTURE)
    found: int = index
    return found


def _packed(picture: v4l2.Format) -> bytes:
    return v4l2.FORMAT_STRUCT.pack(
        v4l2.CAPTURE,
        picture.width_px,
        picture.height_px,
        v4l2.fourcc(picture.name),
        1,
        picture.bytes_per_line,
        picture.bytes_total,
        8,
    )
