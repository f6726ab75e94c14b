"""Reference scene of the window methods: a picture in closed form and the true mean radiance.

A Lambertian patch with a texture of smooth waves lies under a lamp at a finite distance, seen
through the pinhole with its cos^4. The truth is the mean over the patch, by quadrature on the
sample, which no method that sees only pixels can know.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from acquisition.benchmark.demo_scan import shipped_rig
from instrument.geometry import FloatArray, lamp_direction
from instrument.pinhole import Pinhole, apply_homography, rectangle_mm

PATCH_MM = 20.0
LAMP_MM, LAMP_DEG = 1000.0, 45.0
WAVE_DEPTH = 0.05
_WAVES_MM = (9.0, 13.0)  # the texture is coarser than any pixel here
_MARGIN_PX = 3
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(60)


@cache
def shipped_camera(rig: str = "bench_12bit") -> Pinhole:
    """Return the camera of a shipped rig; by default that of the demonstration."""
    return Pinhole.of(shipped_rig(rig))


def irradiance(points_mm: FloatArray) -> FloatArray:
    """Return the lamp's irradiance at points (..., 2) in mm, relative to that on the axis."""
    x, y = points_mm[..., 0], points_mm[..., 1]
    lamp = LAMP_MM * lamp_direction(LAMP_DEG, 0.0)
    squared = (x - lamp[0]) ** 2 + (y - lamp[1]) ** 2 + lamp[2] ** 2
    return np.asarray((LAMP_MM**2 / squared) ** 1.5)


def radiance(points_mm: FloatArray) -> FloatArray:
    """Return texture times irradiance at points (..., 2) of the sample in mm, relative."""
    x, y = points_mm[..., 0], points_mm[..., 1]
    texture = 1 + WAVE_DEPTH * np.sin(2 * np.pi * x / _WAVES_MM[0] + 0.7)
    texture += WAVE_DEPTH * np.cos(2 * np.pi * y / _WAVES_MM[1] + 0.4)
    return np.asarray(texture * irradiance(points_mm))


def patch_mean(quantity: Callable[[FloatArray], FloatArray], side_mm: float) -> float:
    """Return the mean of a quantity of points (..., 2) in mm over a square patch, by quadrature."""
    points = np.stack(np.meshgrid(_NODES * side_mm / 2, _NODES * side_mm / 2), axis=-1)
    return float(_WEIGHTS @ quantity(points) @ _WEIGHTS / 4)


def picture(theta_r_deg: float, camera: Pinhole) -> FloatArray:
    """Return the image, relative radiance (rows, columns), of the patch and a few pixels around it.

    Each pixel is the mean over its area by 2 x 2 Gauss points; the rest of the image is 0.
    """
    to_plane: FloatArray = np.linalg.inv(camera.homography(theta_r_deg)).astype(np.float64)
    corners = outline(theta_r_deg, camera)
    left, top = np.floor(corners.min(axis=0)).astype(int) - _MARGIN_PX
    right, bottom = np.ceil(corners.max(axis=0)).astype(int) + _MARGIN_PX + 1
    columns, rows = np.meshgrid(np.arange(left, right), np.arange(top, bottom))
    image = np.zeros((camera.height_px, camera.width_px))
    for across in (-1, 1):
        for down in (-1, 1):
            at = columns + across / np.sqrt(12), rows + down / np.sqrt(12)
            seen = radiance(apply_homography(to_plane, np.stack(at, axis=-1).astype(np.float64)))
            image[top:bottom, left:right] += seen * camera.cos4(*at) / 4
    return image


def outline(theta_r_deg: float, camera: Pinhole) -> FloatArray:
    """Return the patch's corners in the image, (4, 2) as (column, row) in pixels."""
    return camera.project(rectangle_mm(PATCH_MM, PATCH_MM), theta_r_deg)
