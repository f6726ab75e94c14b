"""Video4Linux2 requests: numbers, structure layouts, and the calls that need no stream.

Layouts are those of linux/videodev2.h on a 64-bit machine; single-plane capture only.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from struct import Struct
from typing import TypeVar

CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
MMAP = 1  # V4L2_MEMORY_MMAP

_WRITE, _READ = 1, 2


def _request(direction: int, number: int, size: int) -> int:
    return (direction << 30) | (size << 16) | (ord("V") << 8) | number


QUERYCAP = _request(_READ, 0, 104)
ENUM_FMT = _request(_READ | _WRITE, 2, 64)
G_FMT = _request(_READ | _WRITE, 4, 208)
S_FMT = _request(_READ | _WRITE, 5, 208)
REQBUFS = _request(_READ | _WRITE, 8, 20)
QUERYBUF = _request(_READ | _WRITE, 9, 88)
QBUF = _request(_READ | _WRITE, 15, 88)
DQBUF = _request(_READ | _WRITE, 17, 88)
STREAMON = _request(_WRITE, 18, 4)
STREAMOFF = _request(_WRITE, 19, 4)
G_PARM = _request(_READ | _WRITE, 21, 204)
S_PARM = _request(_READ | _WRITE, 22, 204)
G_CTRL = _request(_READ | _WRITE, 27, 8)
S_CTRL = _request(_READ | _WRITE, 28, 8)
QUERYCTRL = _request(_READ | _WRITE, 36, 68)
G_INPUT = _request(_READ, 38, 4)
S_INPUT = _request(_READ | _WRITE, 39, 4)
TRY_FMT = _request(_READ | _WRITE, 64, 208)
ENUM_FRAMESIZES = _request(_READ | _WRITE, 74, 44)

CAPABILITY_STRUCT = Struct("<16s32s32sIII12x")  # driver, card, bus, version, capabilities, device's
FMTDESC_STRUCT = Struct("<III32sI16x")  # index, type, flags, description, fourcc
# type, width, height, fourcc, field, bytes per line, size of the image, colour space, magic number
# of the fields that follow, flags, encoding of colours, quantization
FORMAT_STRUCT = Struct("<I4x11I156x")
REQBUFS_STRUCT = Struct("<IIII4x")  # count, type, memory, capabilities
# index, type, bytes used, flags, field, s, us, sequence, memory, offset, length
BUFFER_STRUCT = Struct("<5I4xqq16xIIQI12x")
PARM_STRUCT = Struct("<IIIII184x")  # type, capability, mode, seconds per frame as a fraction
CONTROL_STRUCT = Struct("<Ii")  # id, value
# id, kind, name, minimum, maximum, step, default, flags
QUERYCTRL_STRUCT = Struct("<II32siiiiI8x")
# index, fourcc, kind, then width, height; or minimum, maximum, step of width and of height
FRAMESIZE_STRUCT = Struct("<IIIIIIIII8x")

JPEG_COLOURS = 7  # V4L2_COLORSPACE_JPEG
# V4L2_QUANTIZATION_DEFAULT, _FULL_RANGE, _LIM_RANGE
DEFAULT_RANGE, FULL_RANGE, LIMITED_RANGE = 0, 1, 2
BUFFER_QUEUED, BUFFER_DONE, BUFFER_ERROR = 0x2, 0x4, 0x40
DISCRETE = 1  # V4L2_FRMSIZE_TYPE_DISCRETE

VIDEO_CAPTURE, MULTI_PLANAR, METADATA = 0x1, 0x1000, 0x0080_0000
STATES_NODE = 0x8000_0000  # V4L2_CAP_DEVICE_CAPS: the last field is of the opened node alone
_PURPOSES = {
    VIDEO_CAPTURE: "for pictures",
    MULTI_PLANAR: "for pictures in several planes, which this program cannot use",
    METADATA: "for metadata, not for pictures",
}

AUTO_WHITE_BALANCE = 0x98090C
GAMMA = 0x980910
AUTOGAIN = 0x980912
GAIN = 0x980913
EXPOSURE_AUTO = 0x9A0901
EXPOSURE_ABSOLUTE = 0x9A0902

KINDS = {
    1: "integer",
    2: "on/off",
    3: "menu",
    4: "button",
    5: "integer64",
    6: "class",
    7: "string",
    8: "bitmask",
    9: "menu",
}
_BIG_ENDIAN, _BIG_ENDIAN_TEXT, _HEX_LETTERS = 1 << 31, "-BE", len("0x12345678")
_NEXT, _DISABLED, _WITHOUT_VALUE = 0x80000000, 0x1, (4, 5, 6, 7)
# V4L2_CTRL_FLAG_READ_ONLY, _INACTIVE (another control decides), _WRITE_ONLY, _VOLATILE
_UNSTEADY = 0x4 | 0x10 | 0x40 | 0x80
_MAX_ENTRIES = 256  # a driver that never refuses an index must not cause an endless loop


def fourcc(name: str) -> int:
    """Return the number of a pixel format's name ("Y16", "GREY", "Y16 -BE", "0x12345678")."""
    if name.startswith("0x") and len(name) == _HEX_LETTERS:
        return int(name, 16)
    number = int.from_bytes(name[:4].ljust(4).encode("ascii"), "little")
    return number | (_BIG_ENDIAN if name[4:] == _BIG_ENDIAN_TEXT else 0)


def fourcc_name(number: int) -> str:
    """Return the name of a pixel format's number, without padding.

    A big-endian format has bit 31 set, and "-BE" in its name as in v4l2-ctl; a number that is not
    four letters is given in hexadecimal.
    """
    letters = (number & ~_BIG_ENDIAN).to_bytes(4, "little").decode("latin-1")
    if not (letters.isascii() and letters.isprintable()):
        return f"0x{number:08x}"
    return letters + _BIG_ENDIAN_TEXT if number & _BIG_ENDIAN else letters.rstrip()


def text(raw: bytes) -> str:
    """Decode a zero-terminated text of a structure."""
    return raw.split(b"\0", 1)[0].decode("utf-8", "replace")


@dataclass(frozen=True, slots=True)
class Capability:
    """Driver, card and bus as reported by a device, and the V4L2_CAP_ bits of the opened node."""

    driver: str
    card: str
    bus: str
    node: int

    @property
    def captures(self) -> bool:
        """True if this node delivers pictures in one plane, as the driver here needs them."""
        return bool(self.node & VIDEO_CAPTURE)

    @property
    def purpose(self) -> str:
        """Purpose of this node in words."""
        for bit, purpose in _PURPOSES.items():
            if self.node & bit:
                return purpose
        return "of another purpose than pictures"


@dataclass(frozen=True, slots=True)
class Format:
    """Image format of a device; `limited_range`: black is at 16 and white at 235."""

    name: str
    width_px: int
    height_px: int
    bytes_per_line: int
    bytes_total: int
    limited_range: bool = False


@dataclass(frozen=True, slots=True)
class Control:
    """A control, its range as in the structure, and its value; None if it cannot be read.

    `steady`: the device never changes it by itself.
    """

    number: int
    name: str
    kind: str
    minimum: int
    maximum: int
    step: int
    default: int
    value: int | None = None
    steady: bool = True


@dataclass(frozen=True, slots=True)
class Buffer:
    """The state of one buffer of a stream; the time stamp is the device's own, in seconds."""

    index: int
    bytes_used: int
    flags: int
    time_s: float
    sequence: int


@contextmanager
def opened(device: str) -> Iterator[int]:
    """Open a separate descriptor on `device`, for queries and controls but not for streaming."""
    descriptor = os.open(device, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def _call(descriptor: int, request: int, argument: bytes) -> bytes:
    """Make one request and return the structure filled in; raises OSError."""
    memory = bytearray(argument)
    fcntl.ioctl(descriptor, request, memory)
    return bytes(memory)


def capability(descriptor: int) -> Capability:
    """Return driver, card and bus of the device behind a descriptor."""
    answer = _call(descriptor, QUERYCAP, bytes(CAPABILITY_STRUCT.size))
    driver, card, bus, _, whole_device, node = CAPABILITY_STRUCT.unpack(answer)
    own = node if whole_device & STATES_NODE else whole_device
    return Capability(text(driver), text(card), text(bus), own)


def current_format(descriptor: int) -> Format:
    """Return the device's image format."""
    asked = FORMAT_STRUCT.pack(CAPTURE, *[0] * 11)
    answer = FORMAT_STRUCT.unpack(_call(descriptor, G_FMT, asked))
    _, width, height, number, _, per_line, total, colours, _, _, _, quantization = answer
    name = fourcc_name(number)
    limited = _has_limited_range(name, colours, quantization)
    return Format(name, width, height, per_line, total, limited)


def _has_limited_range(name: str, colours: int, quantization: int) -> bool:
    """Return True for luma from 16 to 235.

    A driver that states no range means limited range for all colours except those of JPEG
    (V4L2_MAP_QUANTIZATION_DEFAULT in linux/videodev2.h).
    """
    if quantization == DEFAULT_RANGE:
        quantization = FULL_RANGE if colours == JPEG_COLOURS else LIMITED_RANGE
    return name == "YUYV" and quantization == LIMITED_RANGE


def frame_period_s(descriptor: int) -> float | None:
    """Return the frame period stated by the device, in seconds, or None."""
    try:
        answer = _call(descriptor, G_PARM, PARM_STRUCT.pack(CAPTURE, 0, 0, 0, 0))
    except OSError:
        return None
    numerator, denominator = PARM_STRUCT.unpack(answer)[3:]
    return numerator / denominator if numerator and denominator else None


def buffer_state(descriptor: int, index: int) -> Buffer:
    """Return the state of one buffer; the descriptor must be the one that streams."""
    asked = BUFFER_STRUCT.pack(index, CAPTURE, 0, 0, 0, 0, 0, 0, MMAP, 0, 0)
    answer = BUFFER_STRUCT.unpack(_call(descriptor, QUERYBUF, asked))
    number, _, used, flags, _, seconds, microseconds, sequence, *_ = answer
    return Buffer(number, used, flags, seconds + microseconds * 1e-6, sequence)


def control_value(descriptor: int, number: int) -> int:
    """Return the value of a control."""
    answer = _call(descriptor, G_CTRL, CONTROL_STRUCT.pack(number, 0))
    value: int = CONTROL_STRUCT.unpack(answer)[1]
    return value


def set_control(descriptor: int, number: int, value: int) -> None:
    """Set a control; the device may clamp the value silently, so read it back."""
    _call(descriptor, S_CTRL, CONTROL_STRUCT.pack(number, value))


def control(descriptor: int, number: int) -> Control | None:
    """Return a control's range and value; None if the device has no such control."""
    try:
        answer = _call(descriptor, QUERYCTRL, QUERYCTRL_STRUCT.pack(number, 0, b"", *[0] * 5))
    except OSError:
        return None
    found, kind, name, minimum, maximum, step, default, flags = QUERYCTRL_STRUCT.unpack(answer)
    if flags & _DISABLED:
        return None
    value = None if kind in _WITHOUT_VALUE else _value_or_none(descriptor, found)
    label = KINDS.get(kind, str(kind))
    steady = not flags & _UNSTEADY
    return Control(found, text(name), label, minimum, maximum, step, default, value, steady)


def _value_or_none(descriptor: int, number: int) -> int | None:
    try:
        return control_value(descriptor, number)
    except OSError:
        return None  # a control that can only be written


def controls(descriptor: int) -> list[Control]:
    """Return all controls except the headings of their classes."""
    found: list[Control] = []
    number = 0
    while True:
        asked = QUERYCTRL_STRUCT.pack(number | _NEXT, 0, b"", *[0] * 5)
        try:
            answer = _call(descriptor, QUERYCTRL, asked)
        except OSError:
            return found
        before, number = number, QUERYCTRL_STRUCT.unpack(answer)[0]
        if number <= before:
            return found  # a driver that never refuses
        entry = control(descriptor, number)
        if entry is not None and entry.kind != "class":
            found.append(entry)


Found = TypeVar("Found")


def _numbered(ask: Callable[[int], Found]) -> Iterator[Found]:
    """Yield the device's answers for index 0, 1, 2 … until it refuses one."""
    for number in range(_MAX_ENTRIES):
        try:
            answer = ask(number)
        except OSError:
            return
        yield answer


def formats(descriptor: int) -> list[str]:
    """Return the names of the pixel formats that the device offers."""

    def ask(index: int) -> str:
        asked = FMTDESC_STRUCT.pack(index, CAPTURE, 0, b"", 0)
        return fourcc_name(FMTDESC_STRUCT.unpack(_call(descriptor, ENUM_FMT, asked))[4])

    return list(_numbered(ask))


def sizes(descriptor: int, pixel_format: str) -> list[str]:
    """Return the sizes of a format in pixels: "640 x 480", or one range with its steps."""
    found = []
    for kind, *numbers in _numbered(lambda n: _size(descriptor, pixel_format, n)):
        if kind == DISCRETE:
            found.append(f"{numbers[0]} x {numbers[1]}")
            continue
        min_x, max_x, step_x, min_y, max_y, step_y = numbers
        span = f"{min_x} x {min_y} to {max_x} x {max_y}"
        return [f"{span} in steps of {step_x} x {step_y}"]
    return found


def _size(descriptor: int, pixel_format: str, index: int) -> tuple[int, ...]:
    asked = FRAMESIZE_STRUCT.pack(index, fourcc(pixel_format), *[0] * 7)
    answer = FRAMESIZE_STRUCT.unpack(_call(descriptor, ENUM_FRAMESIZES, asked))
    return answer[2:]
