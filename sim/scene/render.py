"""What the simulated camera sees: the flat sample in true perspective, in electrons per second.

The radiance varies slowly over the picture, so it is worked out on a small Chebyshev grid of
pixels (each averaged over the lamp's and the lens's solid angle as far as that changes it) and
interpolated to all others; the albedo's texture, the sample's outline and cos^4 follow per pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from analysis.data.acceptance import Acceptance, radiance, rings_each
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography, rectangle_mm
from instrument.pixel_coverage import Coverage, polygon_coverage
from sim.scene.scene import Scene

NODES = 9  # a side; the interpolation error then stays below 1e-5 of the radiance (see the tests)

_VIEWS = np.arange(-89.0, 90.0)

FloatImage = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class View:
    """The surface's outline in the picture and the map from its plane."""

    homography: FloatArray
    outline: Coverage


def electrons_per_s(scene: Scene) -> FloatImage:
    """Mean photo-electrons per second of every pixel, `image[row, column]`, lamp at level 1."""
    rig = scene.rig
    view = _view(scene)
    picture = np.full(
        (rig.camera.height_px, rig.camera.width_px), _background(scene), dtype=np.float32
    )
    crop = view.outline.crop
    if view.outline.fraction.size:
        covered = view.outline.fraction.astype(np.float32)
        picture[crop] += covered * (_surface(scene, view) - picture[crop])
    picture *= _response(Pinhole.of(rig), rig.lamp.white_electrons_per_s)
    return picture


def _view(scene: Scene) -> View:
    pinhole, size = Pinhole.of(scene.rig), scene.protocol.sample
    homography = pinhole.homography(
        scene.true_deg["theta_r"], scene.rig.simulation.sample_height_mm
    )
    corners = apply_homography(homography, rectangle_mm(size.width_mm, size.height_mm))
    return View(homography, polygon_coverage(corners, pinhole.width_px, pinhole.height_px))


def _background(scene: Scene) -> float:
    """Radiance of the dark bench behind the sample, as a Lambertian surface."""
    cos_i = max(0.0, float(np.cos(np.radians(scene.true_deg["theta_i"]))))
    return scene.rig.simulation.background_reflectance / np.pi * cos_i


def _surface(scene: Scene, view: View) -> FloatImage:
    """Radiance of the surface over the outline's crop, for irradiance 1 at normal incidence."""
    rows, columns = view.outline.fraction.shape
    grid_x, matrix_x = _nodes(columns)
    grid_y, matrix_y = _nodes(rows)
    columns_px, rows_px = np.meshgrid(view.outline.column + grid_x, view.outline.row + grid_y)
    pixels: FloatArray = np.stack([columns_px, rows_px], axis=-1)
    to_plane: FloatArray = np.linalg.inv(view.homography).astype(np.float64)
    values = _radiance_at(scene, apply_homography(to_plane, pixels))
    smooth: FloatImage = (matrix_y @ values.astype(np.float32)) @ matrix_x.T
    if scene.surface == "sample" and scene.sample.mottling > 0:
        smooth *= 1 + _texture(scene, view)
    return smooth


def _nodes(pixels: int) -> tuple[FloatArray, FloatImage]:
    """Chebyshev points over `pixels` pixels and the matrix (pixels, NODES) that interpolates."""
    points = chebyshev.chebpts1(NODES).astype(np.float64)
    half = max(pixels - 1, 1) / 2
    to_values = np.linalg.inv(chebyshev.chebvander(points, NODES - 1))
    everywhere = chebyshev.chebvander(np.arange(pixels) / half - 1, NODES - 1)
    return (points + 1) * half, (everywhere @ to_values).astype(np.float32)


def _radiance_at(scene: Scene, points_mm: FloatArray) -> FloatArray:
    """Radiance at points (..., 2) of the surface, seen from the lens."""
    height = np.full(points_mm.shape[:-1], scene.rig.simulation.sample_height_mm)
    flat = np.dstack([points_mm, height]).reshape(-1, 3)
    angles = (scene.true_deg["theta_i"], scene.true_deg["theta_r"], scene.true_deg["dphi"])
    values = radiance(scene.brdf(), flat, *angles, _acceptance(scene), _rings(scene))
    return values.reshape(points_mm.shape[:-1])


def _acceptance(scene: Scene) -> Acceptance:
    return Acceptance.of(scene.rig, scene.protocol.window)


def _rings(scene: Scene) -> int:
    """How finely lamp and lens must be averaged: worked out once for every place of the lamp.

    The most of what the whole degrees about the view angle need.
    """
    theta_i, dphi = scene.true_deg["theta_i"], scene.true_deg["dphi"]
    key = (scene.surface, theta_i, dphi)
    if key not in scene.rings:
        scene.rings[key] = rings_each(scene.brdf(), theta_i, _VIEWS, dphi, _acceptance(scene))
    near = np.abs(_VIEWS - scene.true_deg["theta_r"]) <= 1.0
    return int(scene.rings[key][near].max(initial=1))


def _texture(scene: Scene, view: View) -> FloatImage:
    """Relative albedo texture of the sample over the outline's crop."""
    texture, spacing_mm = scene.mottling()
    rows, columns = texture.shape
    texel_to_mm = np.array(
        [
            [spacing_mm, 0, -spacing_mm * (columns - 1) / 2],
            [0, spacing_mm, -spacing_mm * (rows - 1) / 2],
            [0, 0, 1.0],
        ]
    )
    to_crop = np.array([[1, 0, -view.outline.column], [0, 1, -view.outline.row], [0, 0, 1.0]])
    height, width = view.outline.fraction.shape
    warped = cv2.warpPerspective(
        texture.astype(np.float32),
        to_crop @ view.homography @ texel_to_mm,
        (width, height),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    return np.asarray(warped, dtype=np.float32)


@lru_cache(maxsize=4)
def _response(pinhole: Pinhole, white_electrons_per_s: float) -> FloatImage:
    """Electrons per second and radiance: white at normal incidence is 1/pi; times cos^4 (81)."""
    rows, columns = np.ogrid[: pinhole.height_px, : pinhole.width_px]
    return (np.pi * white_electrons_per_s * pinhole.cos4(columns, rows)).astype(np.float32)
