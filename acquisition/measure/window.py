"""The measuring window: always the same patch of the sample, whatever the view angle.

The patch is projected into the picture; every pixel counts by the area of the patch that it sees
(its coverage by the window's outline times the sample's area per pixel), so that the mean is one
over the patch's area and not over pixels: perspective would favour the near side. Each weight is
divided by cos^4 (1991, equation 81). Oren and Nayar 1995, section 5: "the image window size is
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


@dataclass(frozen=True, slots=True)
class Window:
    """Weights of the pixels of one view angle.

    `weights` (rows, columns) over `crop`; their sum is 1 but for the division by cos^4.
    `counted`: pixels of the crop with a weight. `outline_px` (4, 2) as (column, row); `pixels`
    is the number of whole pixels' worth.
    `shift_px_per_mm` (columns, rows): how far the surface's picture moves for every mm that it
    stands nearer to the camera.
    """

    crop: tuple[slice, slice]
    weights: FloatArray
    counted: BoolArray
    outline_px: FloatArray
    pixels: float
    inside_frame: bool
    shift_px_per_mm: tuple[float, float]

    def mean(self, image: FloatArray) -> float:
        """Area-weighted mean of a picture's crop; nan where the window sees no pixel."""
        return float(np.vdot(self.weights, image)) if self.pixels > 0 else float("nan")


@lru_cache(maxsize=512)
def window_at(theta_r_deg: float, pinhole: Pinhole, width_mm: float, height_mm: float) -> Window:
    """The window of a patch width_mm x height_mm about the axis, seen from theta_r (signed)."""
    homography = pinhole.homography(theta_r_deg)
    outline = apply_homography(homography, rectangle_mm(width_mm, height_mm))
    coverage = polygon_coverage(outline, pinhole.width_px, pinhole.height_px)
    rows, columns = np.ogrid[coverage.crop]
    area = coverage.fraction * area_per_pixel_mm2(homography, columns, rows)
    total = float(area.sum())
    weights = area / pinhole.cos4(columns, rows) / total if total > 0 else area
    axis = [0.0, 0.0]
    shift = pinhole.project(axis, theta_r_deg, 1.0) - pinhole.project(axis, theta_r_deg)
    return Window(
        coverage.crop,
        weights,
        weights > 0,
        outline,
        float(coverage.fraction.sum()),
        coverage.inside_frame,
        (float(shift[0]), float(shift[1])),
    )
