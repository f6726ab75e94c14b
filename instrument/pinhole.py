"""Pinhole model of the camera on the beam: projection of the sample's plane to pixels.

The simulated camera and the measuring window use the same model. Pixel coordinates are (column,
row); the centre of pixel `image[row, column]` has integer coordinates, so the pixel extends from
column - 1/2 to column + 1/2. At theta_r = 0 without roll, the column increases with the sample's x
and the row decreases with its y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from instrument.config.rig import Rig
from instrument.geometry import FloatArray, camera_direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Pinhole:
    """Camera at the end of the beam, aimed so that the rotation axis appears at a given pixel.

    distortion: as the key of a rig file. Homographies, and the measuring window, are without it.
    """

    beam_length_mm: float
    field_width_mm: float
    width_px: int
    height_px: int
    axis_column_px: float
    axis_row_px: float
    roll_deg: float
    distortion: float = 0.0

    @classmethod
    def of(cls, rig: Rig) -> Pinhole:
        """Return the camera that a rig file describes."""
        camera = rig.camera
        return cls(
            beam_length_mm=rig.beam_length_mm,
            field_width_mm=camera.field_width_mm,
            width_px=camera.width_px,
            height_px=camera.height_px,
            axis_column_px=camera.axis_column_px,
            axis_row_px=camera.axis_row_px,
            roll_deg=camera.roll_deg,
            distortion=camera.distortion,
        )

    @property
    def focal_px(self) -> float:
        """Focal length in pixels: the image width covers `field_width_mm` at the axis."""
        return self.beam_length_mm * self.width_px / self.field_width_mm

    @property
    def _centre_px(self) -> FloatArray:
        """Principal point: the middle of the image, (column, row)."""
        return np.array([(self.width_px - 1) / 2, (self.height_px - 1) / 2])

    def homography(self, theta_r_deg: float, height_mm: float = 0.0) -> FloatArray:
        """Return the 3 x 3 homography from the plane z = height_mm to the image.

        It maps (x, y, 1) in mm to (column, row, 1) in pixels, times a depth. `theta_r_deg` is
        signed. The camera's position is beam_length_mm * camera_direction. Read-only: the last
        ones are kept.
        """
        return _kept_homography(self, theta_r_deg, height_mm)

    def _homography(self, theta_r_deg: float, height_mm: float) -> FloatArray:
        x, y, z = (self.beam_length_mm * camera_direction(theta_r_deg)).tolist()
        plane = np.array([[1.0, 0, -x], [0, 1.0, -y], [0, 0, height_mm - z]])
        matrix: FloatArray = self._intrinsic() @ self._orientation(theta_r_deg) @ plane
        return matrix

    def project(
        self, points_mm: ArrayLike, theta_r_deg: float, height_mm: float = 0.0
    ) -> FloatArray:
        """Map points (..., 2) mm on the plane z = height_mm to (..., 2) pixels, column first."""
        return apply_homography(self.homography(theta_r_deg, height_mm), points_mm)

    def cos4(self, columns: ArrayLike, rows: ArrayLike) -> FloatArray:
        """Return the relative irradiance of pixels: cos^4 of the angle from the optical axis.

        Columns and rows in pixels, scalars or arrays that broadcast. Nayar, Ikeuchi and Kanade
        1991, equation (81).
        """
        centre = self._centre_px
        offset2 = (np.asarray(columns, dtype=np.float64) - centre[0]) ** 2 + (
            np.asarray(rows, dtype=np.float64) - centre[1]
        ) ** 2
        falloff: FloatArray = (1.0 + offset2 / self.focal_px**2) ** -2
        return falloff

    def from_middle(self, points_px: FloatArray) -> FloatArray:
        """Return the distance (...) of points (..., 2) in pixels from the picture's middle.

        In units of half its diagonal.
        """
        half_px = math.hypot(self.width_px, self.height_px) / 2
        return np.asarray(np.linalg.norm(points_px - self._centre_px, axis=-1) / half_px)

    def bent(self, points_px: FloatArray) -> FloatArray:
        """Return where distortion shows points (..., 2) of the ideal picture, in pixels.

        The first radial term of OpenCV's model; the rotation axis stays at its pixel.
        """
        axis_px = np.array([self.axis_column_px, self.axis_row_px])
        return points_px + self._shift(points_px) - self._shift(axis_px)

    def _shift(self, points_px: FloatArray) -> FloatArray:
        grown = self.distortion * self.from_middle(points_px)[..., np.newaxis] ** 2
        return np.asarray(grown * (points_px - self._centre_px))

    def _intrinsic(self) -> FloatArray:
        column, row = self._centre_px
        focal = self.focal_px
        return np.array([[focal, 0, column], [0, focal, row], [0, 0, 1.0]])

    def _orientation(self, theta_r_deg: float) -> FloatArray:
        """Return the rotation from the sample's axes to the camera's (right, down, forward)."""
        theta_r, roll = math.radians(theta_r_deg), math.radians(self.roll_deg)
        c, s = math.cos(theta_r), math.sin(theta_r)
        look_at_axis = np.array([[c, 0, -s], [0, -1.0, 0], [-s, 0, -c]])
        c, s = math.cos(roll), math.sin(roll)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        orientation: FloatArray = self._aim() @ turn @ look_at_axis
        return orientation

    def _aim(self) -> FloatArray:
        """Return the smallest rotation that takes the axis from the image centre to its pixel."""
        column, row = self._centre_px.tolist()
        x, y = self.axis_column_px - column, self.axis_row_px - row
        distance = math.hypot(x, y, self.focal_px)
        x, y, z = x / distance, y / distance, self.focal_px / distance
        return np.array(
            [
                [1 - x * x / (1 + z), -x * y / (1 + z), x],
                [-x * y / (1 + z), 1 - y * y / (1 + z), y],
                [-x, -y, z],
            ]
        )


@lru_cache(maxsize=64)
def _kept_homography(camera: Pinhole, theta_r_deg: float, height_mm: float) -> FloatArray:
    matrix = camera._homography(theta_r_deg, height_mm)
    matrix.flags.writeable = False
    return matrix


def apply_homography(matrix: FloatArray, points: ArrayLike) -> FloatArray:
    """Map points (..., 2) by a 3 x 3 homography; units as in `Pinhole.homography`."""
    points = np.asarray(points, dtype=np.float64)
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    result: FloatArray = mapped[..., :2] / mapped[..., 2:]
    return result


def area_per_pixel_mm2(homography: FloatArray, columns: ArrayLike, rows: ArrayLike) -> FloatArray:
    """Return the area of the plane that a pixel sees, in mm^2, from the inverse homography.

    Columns and rows in pixels, scalars or arrays that broadcast.
    """
    back = np.linalg.inv(homography)
    depth = back[2, 0] * np.asarray(columns) + back[2, 1] * np.asarray(rows) + back[2, 2]
    area: FloatArray = np.abs(np.linalg.det(back) / depth**3)
    return area


def rectangle_mm(width_mm: float, height_mm: float) -> FloatArray:
    """Return the corners (4, 2) in mm of a rectangle centred on the origin of the plane."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    rectangle: FloatArray = corners * np.array([width_mm, height_mm])
    return rectangle
