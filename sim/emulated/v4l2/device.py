"""Emulated V4L2 camera: capabilities, formats, controls and faults.

`EmulatedCamera` is the state that all open file descriptors share. The buffers and the stream of
one descriptor are in `sim.emulated.v4l2.stream`, the exposures in `sim.emulated.v4l2.sensor`;
`sim.emulated.v4l2.server` receives requests. `sim.emulated.usb.uvc_camera` is the same camera as a
USB device.

Transcripts: a UVC camera under uvcvideo as v4l2-ctl shows it in public reports, with the
capabilities 0x84a00001 of the device, 0x04200001 of its node for pictures and 0x04a00000 of that
for metadata (which answers EINVAL to requests for pictures); names of the controls as in Linux 5.16
and later; exposures read back from the kernel's cache, luma ranges and lost cameras as observed
with uvcvideo and vivid of Linux 6.1 (emulated USB).
Not verified on a device: ranges and defaults of the controls, and the timing of frames, which are
chosen; card and driver have names of their own.
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

from drivers.v4l2 import ioctl
from instrument.config.camera import CameraDefects
from sim.defects.camera import limit_range, read_back_s, true_exposure_s

PixelFormat = Literal["GREY", "Y10", "Y16", "YUYV", "RGB3", "BGR3"]
BYTES_PER_PIXEL: Mapping[PixelFormat, int] = {
    "GREY": 1, "Y10": 2, "Y16": 2, "YUYV": 2, "RGB3": 3, "BGR3": 3,
}  # fmt: skip
BadFrame = Literal["flagged", "short"]
_NEUTRAL_CHROMA = 128  # U and V of grey
BRIGHTNESS = 0x980900  # V4L2_CID_BRIGHTNESS; changes no counts here
_MANUAL = 1
STEP_S = 1e-4  # V4L2_CID_EXPOSURE_ABSOLUTE counts 100 µs


@dataclass(frozen=True, slots=True)
class Exposure:
    """One exposure of the sensor; `start_s` is a time of the monotonic clock."""

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
class Capabilities:
    """Properties of an emulated camera.

    frames_per_s: upper limit of the frame rate. exposure_range: least, greatest and step of the
    exposure control, in 100 µs. overhead_s: read-out time, from the end of an
    exposure to the frame's time stamp. delay_frames: number of frames after which a new exposure
    time takes effect. reports_filled: False for a driver that shows filled buffers as empty until
    they are dequeued. quantization: range of YUYV, as the number in G_FMT; `defects.limited_range`
    of "declared" overrides it. big_endian: of all formats. node: purpose of the opened node, a
    V4L2_CAP_ bit; one for metadata has no formats. defects: exposures other than those set.
    """

    card: str = "Emulated camera"
    formats: tuple[PixelFormat, ...] = ("GREY", "Y10", "Y16", "YUYV")
    sizes: tuple[tuple[int, int], ...] = ((640, 480), (512, 480), (64, 48))
    frames_per_s: int = 30
    exposure_range: tuple[int, int, int] = (1, 100_000, 1)
    overhead_s: float = 0.002
    delay_frames: int = 0
    row_padding_bytes: int = 0
    stamp_offset_s: float = 0.0
    reports_filled: bool = True
    without_controls: frozenset[int] = frozenset()
    quantization: int = ioctl.FULL_RANGE
    node: int = ioctl.VIDEO_CAPTURE
    big_endian: bool = False
    defects: CameraDefects = field(default_factory=CameraDefects)


@dataclass(slots=True)
class CameraFaults:
    """Present faults of the camera; a test sets and clears them while the camera runs.

    repeats: hands out the last frame over and over, with its number.
    """

    unplugged: bool = False
    frozen: bool = False
    repeats: bool = False
    gives_no_buffers: bool = False
    clamped_exposure: int | None = None  # in 100 µs
    substitute_format: PixelFormat | None = None
    substitute_size: tuple[int, int] | None = None
    refused_controls: set[int] = field(default_factory=set)
    stuck_controls: set[int] = field(default_factory=set)
    # The next frames that reach a buffer; None is a good one.
    bad_frames: deque[BadFrame | None] = field(default_factory=deque)
    failing: defaultdict[str, deque[int]] = field(default_factory=lambda: defaultdict(deque))

    def fail(self, request: str, error: int = errno.EIO, times: int = 1) -> None:
        """Refuse the next `times` requests of this name ("DQBUF", "open", …) with `error`."""
        self.failing[request].extend([error] * times)


class Refused(Exception):
    """Request refused by the device; `number` is the errno that the caller gets."""

    def __init__(self, number: int) -> None:
        super().__init__(errno.errorcode.get(number, str(number)))
        self.number = number


def _standard_controls(exposure_range: tuple[int, int, int]) -> list[ioctl.Control]:
    least, greatest, step = exposure_range
    default = least + (min(max(157, least), greatest) - least) // step * step
    return [
        ioctl.Control(BRIGHTNESS, "Brightness", "integer", 0, 255, 1, 128),
        ioctl.Control(ioctl.AUTO_WHITE_BALANCE, "White Balance, Automatic", "on/off", 0, 1, 1, 1),
        ioctl.Control(ioctl.GAMMA, "Gamma", "integer", 72, 500, 1, 220),
        ioctl.Control(ioctl.AUTOGAIN, "Gain, Automatic", "on/off", 0, 1, 1, 1),
        ioctl.Control(ioctl.GAIN, "Gain", "integer", 0, 480, 10, 100),
        ioctl.Control(ioctl.EXPOSURE_AUTO, "Auto Exposure", "menu", 0, 3, 1, 3),
        ioctl.Control(
            ioctl.EXPOSURE_ABSOLUTE,
            "Exposure Time, Absolute",
            "integer",
            least,
            greatest,
            step,
            default,
        ),
    ]


class EmulatedCamera:
    """Camera whose settings are shared by all open descriptors.

    `snapshot()` is called at the start of an exposure and captures the scene; its result is passed
    to `render(exposure, snapshot)` when the frame is dequeued, which returns `image[row, column]`
    in counts.

    `requests` counts the requests by name; `streamer` is the one stream that has buffers (others
    get EBUSY); `times_unplugged` tells a descriptor opened before an unplugging from a newer one.
    """

    def __init__(
        self,
        render: Render,
        snapshot: Snapshot = lambda: None,
        capabilities: Capabilities | None = None,
    ) -> None:
        self.capabilities = capabilities or Capabilities()
        self.render, self.snapshot = render, snapshot
        self.faults = CameraFaults()
        self.requests: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._on_unplug: set[Callable[[], None]] = set()
        self.streamer: object = None
        self.times_unplugged = 0
        missing = self.capabilities.without_controls
        controls = _standard_controls(self.capabilities.exposure_range)
        self._controls = {c.number: c for c in controls if c.number not in missing}
        self.restart()

    def restart(self) -> None:
        """Reset format and controls to their defaults, as at power-on."""
        self._values = {number: c.default for number, c in self._controls.items()}
        self.pixel_format: PixelFormat = self.capabilities.formats[0]
        self.size = self.capabilities.sizes[0]
        self.frame_interval_s = 1 / self.capabilities.frames_per_s

    # Faults

    def unplug(self) -> None:
        """Disconnect the camera: pending waits end with ENODEV."""
        self.faults.unplugged = True
        self.times_unplugged += 1
        with self._lock:
            wake_all = list(self._on_unplug)
        for wake in wake_all:
            wake()

    def replug(self) -> None:
        """Connect the camera again, with default settings."""
        self.restart()
        self.faults.unplugged = False

    def watch_unplug(self, wake: Callable[[], None], enabled: bool) -> None:
        """Enable or disable calling `wake` when the camera is unplugged."""
        with self._lock:
            (self._on_unplug.add if enabled else self._on_unplug.discard)(wake)

    def admit(self, request: str) -> None:
        """Count a request; raise `Refused` if a fault makes it fail."""
        self.requests[request] += 1
        if self.faults.unplugged:
            raise Refused(errno.ENOENT if request == "open" else errno.ENODEV)
        if self.faults.failing[request]:
            raise Refused(self.faults.failing[request].popleft())

    # Controls

    def controls(self) -> Mapping[int, ioctl.Control]:
        """Return the controls by number, with their present values."""
        return {n: replace(c, value=self._values[n]) for n, c in self._controls.items()}

    def value(self, number: int) -> int:
        """Return the value of a control."""
        if number not in self._values:
            raise Refused(errno.EINVAL)
        return self._values[number]

    def set_value(self, number: int, value: int) -> int:
        """Set a control and return its value, silently clamped to range and step as Linux does."""
        control = self._controls.get(number)
        if control is None:
            raise Refused(errno.EINVAL)
        if number in self.faults.refused_controls or self._is_automatic(number):
            raise Refused(errno.EACCES)
        if number not in self.faults.stuck_controls:
            steps = min(max(value, control.minimum), control.maximum) - control.minimum
            self._values[number] = control.minimum + steps // control.step * control.step
            self._change_exposure(number)
        return self._values[number]

    def _is_automatic(self, number: int) -> bool:
        """True for the exposure while auto-exposure is on: it cannot be set then."""
        automatic = self._values.get(ioctl.EXPOSURE_AUTO, _MANUAL) != _MANUAL
        return number == ioctl.EXPOSURE_ABSOLUTE and automatic

    def _change_exposure(self, number: int) -> None:
        """Let the faults and defects change an exposure that has been set, and its read-back."""
        if number != ioctl.EXPOSURE_ABSOLUTE:
            return
        steps, clamp = self._values[number], self.faults.clamped_exposure
        steps = steps if clamp is None else min(steps, clamp)
        known_s = read_back_s(steps * STEP_S, self.capabilities.defects)
        self._values[number] = round(known_s / STEP_S)

    @property
    def exposure_s(self) -> float:
        """Present exposure time of the sensor in seconds."""
        set_s = self._values[ioctl.EXPOSURE_ABSOLUTE] * STEP_S
        return true_exposure_s(set_s, self.capabilities.defects)

    @property
    def quantization(self) -> int:
        """Range of YUYV's luma that the camera declares."""
        declared = self.capabilities.defects.limited_range == "declared"
        return ioctl.LIMITED_RANGE if declared else self.capabilities.quantization

    @property
    def gain(self) -> int:
        """Present gain; 0 if the camera has no such control."""
        return self._values.get(ioctl.GAIN, 0)

    # Format and frames

    def nearest_format(self, name: str, width: int, height: int) -> ioctl.Format:
        """Return the supported format nearest to the requested one, as drivers adjust it."""
        faults, formats = self.faults, self.capabilities.formats
        chosen = next((f for f in formats if f == name), formats[0])
        chosen = faults.substitute_format or chosen
        size = min(self.capabilities.sizes, key=lambda s: abs(s[0] - width) + abs(s[1] - height))
        return self._format(chosen, faults.substitute_size or size)

    def set_format(self, chosen: ioctl.Format) -> None:
        """Use this format from now on."""
        self.pixel_format = next(f for f in BYTES_PER_PIXEL if f == chosen.name)
        self.size = (chosen.width_px, chosen.height_px)

    def format(self) -> ioctl.Format:
        """Return the present format."""
        return self._format(self.pixel_format, self.size)

    def _format(self, name: PixelFormat, size: tuple[int, int]) -> ioctl.Format:
        per_line = size[0] * BYTES_PER_PIXEL[name] + self.capabilities.row_padding_bytes
        return ioctl.Format(name, *size, per_line, per_line * size[1])

    def frame_bytes(self, exposure: Exposure, snapshot: object) -> NDArray[np.uint8]:
        """Render a frame; return its bytes in the exposure's pixel format, shape (bytes,)."""
        image = limit_range(self.render(exposure, snapshot), self.capabilities.defects)
        if exposure.pixel_format == "YUYV" and image.ndim == 2:
            image = np.dstack(
                [image.astype(np.uint8), np.full(image.shape, _NEUTRAL_CHROMA, np.uint8)]
            )
        if exposure.pixel_format == "BGR3":
            image = image[..., ::-1]
        wide = exposure.pixel_format in ("Y10", "Y16")
        return np.ascontiguousarray(image, "<u2" if wide else np.uint8).view(np.uint8).ravel()
