"""Measuring window: pixel weights that average the same patch of the sample at every view angle.

The patch is projected into the image. Each pixel is weighted by the area of the patch that it
covers (its overlap with the window's outline times the sample area per pixel): the mean is over
the patch's area and not over pixels, which perspective would bias to the near side. Each weight
is divided by cos^4 (1991, equation 81). Oren and Nayar 1995, section 5: "the image window size is
varied as a function of sensor direction to ensure that the same area on the sample is always
used".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from instrument.geometry import BoolArray, FloatArray
from instrument.pinhole import Pinhole, apply_homography, area_per_pixel_mm2, rectangle_mm
from instrument.pixel_coverage import polygon_coverage


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Pixel weights of one view angle.

    `weights` (rows, columns) over `crop`, dimensionless; before the division by cos^4 they sum
    to 1. `counted` (rows, columns): True where the weight is positive. `outline_px` (4, 2) as
    (column, row). `pixels`: area of the window in pixels. `shift_px_per_mm` (columns, rows): shift
    of the image for each mm that the surface is closer to the camera.
    """

    crop: tuple[slice, slice]
    weights: FloatArray
    counted: BoolArray
    outline_px: FloatArray
    pixels: float
    inside_frame: bool
    shift_px_per_mm: tuple[float, float]

    def mean(self, image: FloatArray) -> float:
        """Return the weighted mean of an image crop (rows, columns) in its unit; nan if empty."""
        return float(np.vdot(self.weights, image)) if self.pixels > 0 else float("nan")


@lru_cache(maxsize=512)
def window_at(
    theta_r_deg: float,
    pinhole: Pinhole,
    width_mm: float,
    height_mm: float,
    centre_mm: tuple[float, float] = (0.0, 0.0),
) -> Window:
    """Return the window of a patch, centred at (x, y) from the axis, seen from theta_r (signed).

    The last ones are kept.
    """
    return new_window(theta_r_deg, pinhole, width_mm, height_mm, centre_mm)


def new_window(
    theta_r_deg: float,
    pinhole: Pinhole,
    width_mm: float,
    height_mm: float,
    centre_mm: tuple[float, float],
) -> Window:
    """Return a window as `window_at` does, which is not kept: of a place that no other has."""
    homography = pinhole.homography(theta_r_deg)
    outline = apply_homography(homography, rectangle_mm(width_mm, height_mm) + centre_mm)
    coverage = polygon_coverage(outline, pinhole.width_px, pinhole.height_px)
    rows, columns = np.ogrid[coverage.crop]
    area = coverage.fraction * area_per_pixel_mm2(homography, columns, rows)
    total = float(area.sum())
    weights = area / pinhole.cos4(columns, rows) / total if total > 0 else area
    axis = [0.0, 0.0]
    shift = pinhole.project(axis, theta_r_deg, 1.0) - pinhole.project(axis, theta_r_deg)
    return Window(
        crop=coverage.crop,
        weights=weights,
        counted=weights > 0,
        outline_px=outline,
        pixels=float(coverage.fraction.sum()),
        inside_frame=coverage.inside_frame,
        shift_px_per_mm=(float(shift[0]), float(shift[1])),
    )
