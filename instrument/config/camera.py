"""Camera of a rig file: image size, sensor, exposure, and the settings of each driver."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr

from instrument.calibration.camera_calibration import CameraCalibration
from instrument.calibration.response_curve import ResponseCurve
from instrument.config.section import Finite, Name, NotNegative, Positive, Section
from instrument.config.simulated.spread import Size, Spread
from instrument.devices import CHANNELS

V4L2_EXPOSURE_STEP_S = 1e-4
# ITU-R BT.601: luma of limited range has black at 16 and white at 235.
LIMITED_BLACK_DN, LIMITED_WHITE_DN = 16, 235
_BIT_DEPTHS = {
    "GREY": (8, 8), "YUYV": (8, 8), "Y10": (10, 10), "Y16": (9, 16), "RGB3": (8, 8), "BGR3": (8, 8),
}  # fmt: skip
_COLOUR_FORMATS = ("RGB3", "BGR3")


@lru_cache(maxsize=4)
def _linear_counts_dn(curve: ResponseCurve, black_dn: float, max_dn: int) -> NDArray[np.float64]:
    """Return the linear count of each count (max_dn + 1,), in DN."""
    span = max_dn - black_dn
    return black_dn + span * curve.light((np.arange(max_dn + 1.0) - black_dn) / span)


class DarkPatch(Section):
    """Patch beside the sample that reflects almost nothing: a light trap, or black velvet.

    `x_mm`, `y_mm`: its middle in the plane of the sample, from the rotation axis. `width_mm`,
    `height_mm`: its size, of which the middle half is read. `reflectance`: its radiance factor,
    with the standard uncertainty `u_reflectance`.
    """

    x_mm: Finite
    y_mm: Finite
    width_mm: Positive
    height_mm: Positive
    reflectance: Annotated[float, Field(ge=0, le=0.05)]
    u_reflectance: Annotated[float, Field(ge=0, le=0.05)]

    def corners_mm(self) -> NDArray[np.float64]:
        """Return the corners (4, 2) in mm, as (x, y) in the plane of the sample."""
        signs = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        return signs * (self.width_mm, self.height_mm) + (self.x_mm, self.y_mm)


class CameraConfig(Section):
    """Camera on the beam: image, field of view, sensor and exposure.

    `reconnect_s`: time for which a scan waits for a camera whose connection was lost.
    `u_black_level_dn`: standard deviation of the black level from frame to frame; the default is
    that of a clamp which regulates to a fraction of a count. `calibration`: file of `gonio
    calibrate camera`, beside the rig file; counts are made linear with its response curve.
    `dark_patch`: its light is stray light, which is subtracted. `distortion`: relative displacement
    of a point at half the picture's diagonal, to the outside if positive, by the first radial term
    of OpenCV's model; maps of the sample place their cells by it. `channels`: 3 for a camera that
    gives red, green and blue of each pixel; all other keys are of one channel.
    """

    width_px: Annotated[int, Field(ge=16, le=16384)]
    height_px: Annotated[int, Field(ge=16, le=16384)]
    field_width_mm: Positive
    axis_row_px: Finite
    axis_column_px: Finite
    roll_deg: Annotated[float, Field(ge=-180, le=180)] = 0.0
    distortion: Annotated[float, Field(ge=-0.2, le=0.2)] = 0.0
    bit_depth: Annotated[int, Field(ge=8, le=16)]
    channels: Literal[1, 3] = 1
    full_well_electrons: Positive
    read_noise_electrons: NotNegative
    dark_current_electrons_per_s: NotNegative
    black_level_dn: NotNegative = 0.0
    u_black_level_dn: NotNegative = 0.25
    min_exposure_s: Positive
    max_exposure_s: Positive
    frame_overhead_s: NotNegative
    reconnect_s: Annotated[float, Field(ge=0, le=3600)] = 30.0
    calibration: Annotated[str, Field(min_length=1, max_length=1000)] | None = None
    dark_patch: DarkPatch | None = None
    _measured: CameraCalibration | None = PrivateAttr(None)

    @property
    def measured(self) -> CameraCalibration | None:
        """Content of the file `calibration`; None without one, and where no scan needs it."""
        return self._measured

    def with_measured(self, measured: CameraCalibration) -> Self:
        """Return a copy that holds the content of its `calibration`."""
        camera = self.model_copy()
        camera._measured = measured
        return camera

    def linear_dn(self, counts: NDArray[Any]) -> NDArray[Any]:
        """Return counts of any shape, in DN, made linear in light; unchanged if not calibrated.

        Black and the largest count stay in their place.
        """
        if self._measured is None:
            return counts
        own = self._measured
        table = _linear_counts_dn(own.curve, own.black_dn, self.max_dn)
        return np.asarray(np.take(table, counts, mode="clip"))

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Check the order of exposures, the axis inside the image, black level, and channels."""
        if self.min_exposure_s > self.max_exposure_s:
            yield (
                "min_exposure_s",
                f"{self.min_exposure_s:g}; allowed: at most max_exposure_s {self.max_exposure_s:g}",
            )
        for key, size in (("axis_row_px", self.height_px), ("axis_column_px", self.width_px)):
            value = getattr(self, key)
            if not 0 <= value <= size - 1:
                yield key, f"{value:g} is outside the image; allowed: 0 to {size - 1}"
        yield from self._patch_outside()
        if self.is_colour and self.calibration is not None:
            yield (
                "calibration",
                f"{self.calibration} with channels 3; allowed: none, as it is of one channel, and "
                "the others have response curves of their own",
            )
        if self.black_level_dn >= self.max_dn / 2:
            yield (
                "black_level_dn",
                f"{self.black_level_dn:g}; allowed: less than half of full scale, {self.max_dn} DN",
            )
        least = 4 * self.read_noise_electrons / self.electrons_per_dn
        if self.black_level_dn < least:
            yield (
                "black_level_dn",
                f"{self.black_level_dn:g}; allowed: at least {least:.3g}, 4 times the read noise "
                "in counts, or darks are clipped at 0",
            )

    def _patch_outside(self) -> Iterator[tuple[str, str]]:
        """Yield a dark patch that leaves the picture seen along the normal; roll is left aside."""
        patch = self.dark_patch
        if patch is None:
            return
        per_mm = self.width_px / self.field_width_mm
        for middle, extent, axis, size, sign in (
            (patch.x_mm, patch.width_mm, self.axis_column_px, self.width_px, 1.0),
            (patch.y_mm, patch.height_mm, self.axis_row_px, self.height_px, -1.0),
        ):
            ends = [axis + sign * per_mm * (middle + side * extent / 2) for side in (-1.0, 1.0)]
            if min(ends) < -0.5 or max(ends) > size - 0.5:
                text = f"from {middle - extent / 2:g} to {middle + extent / 2:g} mm leaves the "
                low, high = sorted((n - axis) / (sign * per_mm) for n in (-0.5, size - 0.5))
                yield "dark_patch", f"{text}picture; allowed: {low:.3g} to {high:.3g} mm"

    @property
    def is_colour(self) -> bool:
        """True for a camera that gives three channels of each pixel."""
        return self.channels == len(CHANNELS)

    @property
    def max_dn(self) -> int:
        """Largest count of a pixel, in DN."""
        return int(2**self.bit_depth - 1)

    @property
    def electrons_per_dn(self) -> float:
        """Conversion gain: the full well corresponds to the counts above the black level."""
        return self.full_well_electrons / (self.max_dn - self.black_level_dn)

    @property
    def exposure_step_s(self) -> float:
        """Step of which exposures are whole multiples; 0 if any exposure can be set."""
        return 0.0


class SimulatedCameraConfig(CameraConfig):
    """Simulated camera in simulated time, without a driver."""

    driver: Literal["simulated"]


class V4l2CameraConfig(CameraConfig):
    """Video4Linux camera; prefer a /dev/v4l/by-id path as `device`.

    `gain`: in the camera's own unit; if omitted, the camera keeps its gain or has none.
    `exposure_delay_frames`: frames after a change of exposure that may still have the old one.
    `frames_per_s`: requested from the camera; if omitted, 30 per second or what it sets instead.
    `luma_range`: of YUYV; in the limited range white is 235, and black 16 or more.
    """

    driver: Literal["v4l2"]
    device: Name
    pixel_format: Literal["GREY", "Y10", "Y16", "YUYV", "RGB3", "BGR3"]
    gain: int | None = None
    exposure_delay_frames: Annotated[int, Field(ge=0, le=20)] = 2
    frames_per_s: Annotated[int, Field(ge=1, le=1000)] | None = None
    luma_range: Literal["full", "limited"] = "full"

    @property
    def max_dn(self) -> int:
        """Largest count of a pixel, in DN: white of the limited range, if that is used."""
        return LIMITED_WHITE_DN if self.luma_range == "limited" else super().max_dn

    @property
    def exposure_step_s(self) -> float:
        """Unit of V4L2 exposures: 100 microseconds."""
        return V4L2_EXPOSURE_STEP_S

    def mistakes(self) -> Iterator[tuple[str, str]]:
        """Require whole steps of exposure, and a pixel format with enough bits."""
        yield from super().mistakes()
        for key in ("min_exposure_s", "max_exposure_s"):
            steps = getattr(self, key) / V4L2_EXPOSURE_STEP_S
            if not 0.5 < steps < 1e15 or abs(steps - round(steps)) > 1e-6:
                yield key, f"{getattr(self, key):g}; allowed: whole multiples of 0.0001 s"
        if self.is_colour != (self.pixel_format in _COLOUR_FORMATS):
            allowed = "1, as its pixels have one count; in colour: RGB3 or BGR3"
            if not self.is_colour:
                allowed = "3, as its pixels have three counts"
            yield "channels", f"{self.channels}; allowed for {self.pixel_format}: {allowed}"
        low, high = _BIT_DEPTHS[self.pixel_format]
        if not low <= self.bit_depth <= high:
            allowed = f"{low}" if low == high else f"{low} to {high}"
            yield "bit_depth", f"{self.bit_depth}; allowed for {self.pixel_format}: {allowed}"
        if self.luma_range == "limited" and self.pixel_format != "YUYV":
            yield "luma_range", f"limited; allowed for {self.pixel_format}: full"
        elif self.luma_range == "limited" and self.black_level_dn < LIMITED_BLACK_DN:
            text = f"{self.black_level_dn:g}; allowed with luma_range limited: at least "
            yield "black_level_dn", f"{text}{LIMITED_BLACK_DN}"


AnyCamera = Annotated[SimulatedCameraConfig | V4l2CameraConfig, Field(discriminator="driver")]


class DeadPixel(Section):
    """Pixel without any response to light."""

    row: Annotated[int, Field(ge=0)]
    column: Annotated[int, Field(ge=0)]


class HotPixel(DeadPixel):
    """Pixel with a dark current of its own, in addition to that of all pixels."""

    electrons_per_s: Positive


class CameraDefects(Section):
    """Defects that real cameras have; all are absent unless given.

    `fixed_exposure_s`: exposure of every frame, whatever is set. `longest_exposure_s`: longest
    true exposure, as of a camera that cannot expose longer than its frame period. `exposures_s`:
    table of true exposures; the one nearest to the exposure that is set is used. `reads_back`:
    exposure that the camera reports, the one set (like uvcvideo, which answers from its cache) or
    the one taken. `limited_range`: 8-bit counts have black at 16 and white at 235; a YUYV camera
    declares it to the driver or not.

    Response, with black and full scale unchanged: `gamma`: counts go with the light to the power of
    1/gamma. `nonlinearity`: relative excess of the counts of a small signal, which falls linearly
    to 0 at full scale. Pixels, drawn from the rig's seed: `prnu`: relative standard deviation of
    their responses to light. `dsnu_electrons`: standard deviation of their dark signals.
    `hot_share`: share of the pixels that are hot, with dark currents that are distributed
    exponentially about `hot_electrons_per_s`; `dead_share`: share that are dead, `dead_pixels`:
    some by their place.

    Temperature: the sensor warms by `warming_k` after the start of the scan, with the time constant
    `warming_s`; all dark currents double every `doubling_k`.
    """

    fixed_exposure_s: Positive | None = None
    longest_exposure_s: Positive | None = None
    exposures_s: Annotated[list[Positive], Field(min_length=1)] | None = None
    reads_back: Literal["set", "taken"] = "set"
    hot_pixels: list[HotPixel] = Field(default_factory=list)
    limited_range: Literal["none", "declared", "undeclared"] = "none"
    gamma: Annotated[float, Field(ge=0.2, le=5)] = 1.0
    nonlinearity: Annotated[float, Field(ge=-0.5, le=0.5), Spread.SIGNED] = 0.0
    prnu: Annotated[float, Field(ge=0, le=0.2), Spread.SIZE] = 0.0
    dsnu_electrons: Size = 0.0
    dead_pixels: list[DeadPixel] = Field(default_factory=list)
    hot_share: Annotated[float, Field(ge=0, le=0.1), Spread.SIZE] = 0.0
    hot_electrons_per_s: Positive = 2000.0
    dead_share: Annotated[float, Field(ge=0, le=0.1), Spread.SIZE] = 0.0
    warming_k: Size = 0.0
    warming_s: Positive = 1800.0
    doubling_k: Positive = 7.0
