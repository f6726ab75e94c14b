"""An emulated V4L2 camera: what it is, what it is set to, what is wrong with it.

`EmulatedCamera` is the device that all openings share: formats, controls, faults. What an opening
has of its own (buffers, stream) is in `sim.emulated.v4l2.stream`; requests arrive by
`sim.emulated.v4l2.server`.
"""

from __future__ import annotations

import errno
import threading
from collections import Counter, defaultdict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.v4l2 import ioctl as v4l2

PixelFormat = Literal["GREY", "Y10", "Y16", "YUYV"]
BYTES_PER_PIXEL: Mapping[PixelFormat, int] = {"GREY": 1, "Y10": 2, "Y16": 2, "YUYV": 2}
Spoilt = Literal["flagged", "short"]
_GREYS = 128  # the colour that YUYV gives to a grey
_MANUAL = 1


@dataclass(frozen=True, slots=True)
class Exposure:
    """One exposure of the sensor; `start_s` is of the system's monotonic clock."""

    exposure_s: float
    gain: int
    start_s: float
    sequence: int
    pixel_format: PixelFormat
    width_px: int
    height_px: int


Render = Callable[[Exposure, object], NDArray[np.uint8] | NDArray[np.uint16]]
Snapshot = Callable[[], object]


@dataclass(frozen=True, slots=True)
class Description:
    """What an emulated camera can do. Frames come at most `frames_per_s`.

    An exposure ends `overhead_s` before the frame's time stamp: that is the read-out. An exposure
    that is set reaches the sensor `delay_frames` frames late. A driver that does not tell of
    filled buffers shows them as empty until they are taken.
    """

    card: str = "Emulated camera"
    formats: tuple[PixelFormat, ...] = ("GREY", "Y10", "Y16", "YUYV")
    sizes: tuple[tuple[int, int], ...] = ((640, 480), (512, 480), (64, 48))
    frames_per_s: int = 30
    overhead_s: float = 0.002
    delay_frames: int = 0
    row_padding_bytes: int = 0
    stamp_offset_s: float = 0.0
    tells_filled: bool = True
    without_controls: frozenset[int] = frozenset()


@dataclass(slots=True)
class Faults:
    """What is wrong with the camera now; a test sets and clears it while the camera runs."""

    unplugged: bool = False
    frozen: bool = False
    gives_no_buffers: bool = False
    clamped_exposure: int | None = None  # in 100 µs
    substitute_format: PixelFormat | None = None
    substitute_size: tuple[int, int] | None = None
    refused_controls: set[int] = field(default_factory=set)
    stuck_controls: set[int] = field(default_factory=set)
    spoilt: deque[Spoilt] = field(default_factory=deque)  # the frames taken next
    failing: defaultdict[str, deque[int]] = field(default_factory=lambda: defaultdict(deque))

    def fail(self, request: str, error: int = errno.EIO, times: int = 1) -> None:
        """Let the next `times` requests of this name ("DQBUF", "open", …) end in `error`."""
        self.failing[request].extend([error] * times)


class Refused(Exception):
    """A request that the device refuses; `number` is the error number that the caller sees."""

    def __init__(self, number: int) -> None:
        super().__init__(errno.errorcode.get(number, str(number)))
        self.number = number


def _standard_controls() -> list[v4l2.Control]:
    return [
        v4l2.Control(v4l2.AUTO_WHITE_BALANCE, "White Balance, Automatic", "on/off", 0, 1, 1, 1),
        v4l2.Control(v4l2.GAMMA, "Gamma", "integer", 72, 500, 1, 220),
        v4l2.Control(v4l2.AUTOGAIN, "Gain, Automatic", "on/off", 0, 1, 1, 1),
        v4l2.Control(v4l2.GAIN, "Gain", "integer", 0, 480, 10, 100),
        v4l2.Control(v4l2.EXPOSURE_AUTO, "Auto Exposure", "menu", 0, 3, 1, 3),
        v4l2.Control(
            v4l2.EXPOSURE_ABSOLUTE, "Exposure Time, Absolute", "integer", 1, 100_000, 1, 157
        ),
    ]


class EmulatedCamera:
    """The device: what it is set to is seen alike by all who have opened it.

    `snapshot()` is called when an exposure begins and says what the sensor sees; its answer goes
    to `render(exposure, seen)` once somebody takes that frame: `image[row, column]` in counts.
    """

    def __init__(
        self,
        render: Render,
        snapshot: Snapshot = lambda: None,
        description: Description | None = None,
    ) -> None:
        self.description = description or Description()
        self.render, self.snapshot = render, snapshot
        self.faults = Faults()
        self.requests: Counter[str] = Counter()  # how often each was made, for tests
        self._lock = threading.Lock()
        self._on_unplug: set[Callable[[], None]] = set()
        self.streamer: object = None  # the one opening that has buffers; the others get EBUSY
        self.times_unplugged = 0  # whoever opened it before stays without a device
        missing = self.description.without_controls
        self._controls = {c.number: c for c in _standard_controls() if c.number not in missing}
        self._restart()

    def _restart(self) -> None:
        """Power on: everything at its default."""
        self._values = {number: c.default for number, c in self._controls.items()}
        self.pixel_format: PixelFormat = self.description.formats[0]
        self.size = self.description.sizes[0]

    # Faults

    def unplug(self) -> None:
        """Take the camera away: whoever waits for a frame wakes up and finds no device."""
        self.faults.unplugged = True
        self.times_unplugged += 1
        with self._lock:
            wake_all = list(self._on_unplug)
        for wake in wake_all:
            wake()

    def replug(self) -> None:
        """Bring the camera back, at its defaults."""
        self._restart()
        self.faults.unplugged = False

    def watch_unplug(self, wake: Callable[[], None], watching: bool) -> None:
        """Call `wake` when the camera is unplugged, or no longer."""
        with self._lock:
            (self._on_unplug.add if watching else self._on_unplug.discard)(wake)

    def admit(self, request: str) -> None:
        """Refuse a request that is to fail now."""
        self.requests[request] += 1
        if self.faults.unplugged:
            raise Refused(errno.ENOENT if request == "open" else errno.ENODEV)
        if self.faults.failing[request]:
            raise Refused(self.faults.failing[request].popleft())

    # Controls

    def controls(self, *, current: bool = True) -> Mapping[int, v4l2.Control]:
        """The camera's controls by number, with the values they stand at."""
        if not current:
            return self._controls
        return {n: replace(c, value=self._values[n]) for n, c in self._controls.items()}

    def value(self, number: int) -> int:
        """What a control stands at."""
        if number not in self._values:
            raise Refused(errno.EINVAL)
        return self._values[number]

    def set_value(self, number: int, value: int) -> int:
        """Set a control as drivers do: clamped to its range and steps without a word."""
        control = self._controls.get(number)
        if control is None:
            raise Refused(errno.EINVAL)
        if number in self.faults.refused_controls or self._is_automatic(number):
            raise Refused(errno.EACCES)
        if number not in self.faults.stuck_controls:
            steps = min(max(value, control.least), control.greatest) - control.least
            self._values[number] = control.least + steps // control.step * control.step
            self._clamp_exposure()
        return self._values[number]

    def _is_automatic(self, number: int) -> bool:
        """The exposure cannot be set while the camera sets it itself."""
        automatic = self._values.get(v4l2.EXPOSURE_AUTO, _MANUAL) != _MANUAL
        return number == v4l2.EXPOSURE_ABSOLUTE and automatic

    def _clamp_exposure(self) -> None:
        clamp = self.faults.clamped_exposure
        if clamp is not None:
            exposure = self._values[v4l2.EXPOSURE_ABSOLUTE]
            self._values[v4l2.EXPOSURE_ABSOLUTE] = min(exposure, clamp)

    @property
    def exposure_s(self) -> float:
        """The exposure that is set now."""
        return self._values[v4l2.EXPOSURE_ABSOLUTE] * 1e-4

    @property
    def gain(self) -> int:
        """The gain that is set now; 0 where the camera has none."""
        return self._values.get(v4l2.GAIN, 0)

    # Picture

    def nearest(self, asked: str, width: int, height: int) -> v4l2.Format:
        """The format that the camera takes when it is asked for this one: drivers adjust."""
        faults, able = self.faults, self.description
        chosen = next((f for f in able.formats if f == asked), able.formats[0])
        chosen = faults.substitute_format or chosen
        size = min(able.sizes, key=lambda s: abs(s[0] - width) + abs(s[1] - height))
        return self._format(chosen, faults.substitute_size or size)

    def take_format(self, wanted: v4l2.Format) -> None:
        """Use this picture from now on."""
        self.pixel_format = next(f for f in BYTES_PER_PIXEL if f == wanted.name)
        self.size = (wanted.width_px, wanted.height_px)

    def format(self) -> v4l2.Format:
        """The picture that is set now."""
        return self._format(self.pixel_format, self.size)

    def _format(self, name: PixelFormat, size: tuple[int, int]) -> v4l2.Format:
        per_line = size[0] * BYTES_PER_PIXEL[name] + self.description.row_padding_bytes
        return v4l2.Format(name, *size, per_line, per_line * size[1])

    def picture(self, exposure: Exposure, seen: object) -> NDArray[np.uint8]:
        """The bytes of a frame, rendered now."""
        image = self.render(exposure, seen)
        if exposure.pixel_format == "YUYV" and image.ndim == 2:
            image = np.dstack([image.astype(np.uint8), np.full(image.shape, _GREYS, np.uint8)])
        wide = exposure.pixel_format in ("Y10", "Y16")
        return np.ascontiguousarray(image, "<u2" if wide else np.uint8).view(np.uint8).ravel()
