"""Settings of a V4L2 camera, and its exposure in steps of 100 µs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from instrument.errors import DeviceError

PixelFormat = Literal["GREY", "Y10", "Y16", "YUYV", "RGB3", "BGR3"]
_BYTES: dict[PixelFormat, int] = {"GREY": 1, "Y10": 2, "Y16": 2, "YUYV": 2, "RGB3": 3, "BGR3": 3}
_COLOUR: tuple[PixelFormat, ...] = "RGB3", "BGR3"
STEPS_PER_S = 10_000  # V4L2_CID_EXPOSURE_ABSOLUTE counts 100 µs

BUFFERS = 4  # of the stream: one is read while others fill


@dataclass(frozen=True, slots=True, kw_only=True)
class V4l2Settings:
    """Device path of a camera, preferably of /dev/v4l/by-id, and its settings.

    `gain` None leaves the gain as it is (an automatic gain is switched off all the same).
    `frames_per_s` None leaves the rate that the camera chooses for OpenCV's default, 30 per second.
    A new exposure may take effect `exposure_delay_frames` frames late. `limited_range`: YUYV has
    black at 16 and white at 235.
    """

    device: str
    pixel_format: PixelFormat
    width_px: int
    height_px: int
    bit_depth: int
    min_exposure_s: float
    max_exposure_s: float
    gain: int | None = None
    exposure_delay_frames: int = 2
    frames_per_s: int | None = None
    limited_range: bool = False

    def __post_init__(self) -> None:
        self.exposure_steps(self.min_exposure_s)
        self.exposure_steps(self.max_exposure_s)

    @property
    def bytes_per_line(self) -> int:
        """Bytes per row of pixels."""
        return self.width_px * _BYTES[self.pixel_format]

    @property
    def is_colour(self) -> bool:
        """True for a format with a count of red, green and blue for each pixel."""
        return self.pixel_format in _COLOUR

    @property
    def wide(self) -> bool:
        """True for counts of 16 bits."""
        return self.pixel_format in ("Y10", "Y16")

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array returned by OpenCV."""
        size = (self.height_px, self.width_px)
        if self.is_colour or self.pixel_format == "YUYV":
            return (*size, _BYTES[self.pixel_format])
        return size

    @property
    def checked_max_dn(self) -> int | None:
        """Largest possible count of a pixel; None if the pixel format cannot hold a larger one."""
        room = 16 if self.wide else 8
        return 2**self.bit_depth - 1 if self.bit_depth < room else None

    def exposure_steps(self, exposure_s: float) -> int:
        """Convert an exposure to steps of 100 µs; refuse one out of range or between two steps."""
        low, high = self.min_exposure_s, self.max_exposure_s
        if not low <= exposure_s <= high:
            raise DeviceError(
                f"camera {self.device}: exposure {exposure_s:g} s asked for; "
                f"allowed: {low:g} to {high:g} s"
            )
        steps = round(exposure_s * STEPS_PER_S)
        if steps < 1 or abs(exposure_s * STEPS_PER_S - steps) > 1e-6 * steps:
            raise DeviceError(
                f"camera {self.device}: exposure {exposure_s:.10g} s asked for; allowed: "
                f"multiples of 0.0001 s, the nearest is {max(steps, 1) / STEPS_PER_S:g} s"
            )
        return steps
