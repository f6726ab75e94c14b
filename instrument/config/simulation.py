"""Hidden properties of a simulated or emulated rig, with the defects of its camera."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from instrument.config.section import Finite, Positive, Section


class HotPixel(Section):
    """Pixel with a dark current of its own, in addition to that of all pixels."""

    row: Annotated[int, Field(ge=0)]
    column: Annotated[int, Field(ge=0)]
    electrons_per_s: Positive


class CameraDefects(Section):
    """Defects that real cameras have; all are absent unless given.

    `fixed_exposure_s`: exposure of every frame, whatever is set. `longest_exposure_s`: longest
    true exposure, as of a camera that cannot expose longer than its frame period. `exposures_s`:
    table of true exposures; the one nearest to the exposure that is set is used. `reads_back`:
    exposure that the camera reports, the one set (like uvcvideo, which answers from its cache) or
    the true one. `limited_range`: 8-bit counts have black at 16 and white at 235, and a YUYV camera
    declares it to the driver or not.
    """

    fixed_exposure_s: Positive | None = None
    longest_exposure_s: Positive | None = None
    exposures_s: Annotated[list[Positive], Field(min_length=1)] | None = None
    reads_back: Literal["set", "true"] = "set"
    hot_pixels: list[HotPixel] = Field(default_factory=list)
    limited_range: Literal["none", "declared", "undeclared"] = "none"


class Simulation(Section):
    """Hidden properties of a simulated rig: noise seed, lamp drift, position of the sample.

    `sample_height_mm`: distance of the surface from the rotation axis, towards the camera.
    `lamp_drift_per_hour`: relative change of the lamp's output.
    """

    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    sample_height_mm: Finite = 0.0
    lamp_drift_per_hour: Annotated[float, Field(gt=-1, lt=1)] = 0.0
    background_reflectance: Annotated[float, Field(ge=0, le=1)] = 0.02
    camera_defects: CameraDefects = CameraDefects()

    def outside(self, width_px: int, height_px: int) -> Iterator[str]:
        """Yield the hot pixels that lie outside an image of this size, in words."""
        for pixel in self.camera_defects.hot_pixels:
            if pixel.row >= height_px or pixel.column >= width_px:
                yield (
                    f"hot pixel in row {pixel.row}, column {pixel.column}; allowed: rows up to "
                    f"{height_px - 1}, columns up to {width_px - 1}"
                )
