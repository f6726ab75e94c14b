"""Rendering of the scene: the flat sample in true perspective, in electrons per second per pixel.

Radiance varies slowly over the image. It is computed on a small Chebyshev grid of pixels, averaged
over the solid angles of lamp and lens where that matters, and interpolated to all others. Albedo
texture, sample outline and the cos^4 fall-off follow pixel by pixel.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from analysis.data.acceptance import Acceptance, radiance, required_rings
from instrument.config.simulated.defects import LensDefects
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, apply_homography, rectangle_mm
from instrument.pixel_coverage import Coverage, polygon_coverage
from sim.defects.lamp import beam_profile, wall_radiance
from sim.defects.lens import bent_by_lens, transmission
from sim.defects.mechanics import leaning_homography, turned
from sim.defects.picture import scattered
from sim.scene.board import marker_on, marker_size_mm, print_on
from sim.scene.scene import BOARD_PLACES, PAPER, Scene
from sim.scene.variation import blended, region_mm, share_at, shares_to_render

_NODES = 9  # per side: interpolation error below 4e-5 of the radiance, 5e-6 of an image's mean

_VIEW_ANGLES_DEG = np.arange(-89.0, 90.0)

FloatImage = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class _Projection:
    """Homographies to the image from the table and from the surface, and the surface's outline."""

    table: FloatArray
    homography: FloatArray
    outline: Coverage


def electrons_per_s(scene: Scene) -> FloatImage:
    """Return the mean electrons per second of each pixel, (height, width), at lamp level 1."""
    rig = scene.rig
    projection = _project(scene)
    image = np.full(
        (rig.camera.height_px, rig.camera.width_px), _background_radiance(scene), dtype=np.float32
    )
    _show_dark_patch(image, scene)
    _show_markers(image, scene, projection.homography)
    crop = projection.outline.crop
    if projection.outline.fraction.size and scene.mounted is not None:
        covered = projection.outline.fraction.astype(np.float32)
        image[crop] += covered * (_surface_radiance(scene, projection) - image[crop])
    lens = rig.simulation.lens_defects
    image = bent_by_lens(image, lens)
    image *= _response(Pinhole.of(rig), rig.lamp.white_electrons_per_s, lens)
    return scattered(image, scene.world, lens, rig.camera.width_px / rig.camera.field_width_mm)


def _project(scene: Scene) -> _Projection:
    pinhole = Pinhole.of(scene.rig)
    height_mm = 0.0 if scene.mounted is None else scene.heights_mm[scene.mounted]
    table = leaning_homography(
        pinhole, scene.in_plane_angles().theta_r, height_mm, scene.placement.tilt_across_deg
    )
    table = scene.picture_shift() @ table
    homography = table @ scene.placement_matrix()
    corners = apply_homography(homography, rectangle_mm(*scene.size_mm))
    return _Projection(
        table, homography, polygon_coverage(corners, pinhole.width_px, pinhole.height_px)
    )


def _show_dark_patch(image: FloatImage, scene: Scene) -> None:
    """Draw the dark patch of the sample holder, which lies on the table, into a picture of it."""
    patch, pinhole = scene.rig.camera.dark_patch, Pinhole.of(scene.rig)
    if patch is None:
        return
    table = scene.picture_shift() @ pinhole.homography(scene.table_angles().theta_r)
    corners = apply_homography(table, patch.corners_mm())
    outline = polygon_coverage(corners, pinhole.width_px, pinhole.height_px)
    radiance_of_patch = _matt_radiance(scene, scene.patch_reflectance(patch))
    covered = outline.fraction.astype(np.float32)
    image[outline.crop] += covered * (np.float32(radiance_of_patch) - image[outline.crop])


def _show_markers(image: FloatImage, scene: Scene, homography: FloatArray) -> None:
    """Draw the markers on the plate of the sample, by the homography of points on the plate."""
    if scene.markers is None or scene.mounted != "sample":
        return
    size = marker_size_mm(scene.markers.size_mm)
    paper = _matt_radiance(scene, PAPER)
    for number, (x, y) in enumerate(scene.markers.centres_mm):
        own = homography @ np.array([[1.0, 0, x], [0, 1.0, y], [0, 0, 1.0]])
        corners = apply_homography(own, rectangle_mm(size, size))
        outline = polygon_coverage(corners, image.shape[1], image.shape[0])
        if outline.fraction.size:
            seen = np.float32(paper) * marker_on(number, scene.markers.size_mm, own, outline)
            covered = outline.fraction.astype(np.float32)
            image[outline.crop] += covered * (seen - image[outline.crop])


def _background_radiance(scene: Scene) -> float:
    """Radiance of the dark optical table behind the sample, taken as Lambertian."""
    return _matt_radiance(scene, scene.rig.simulation.background_reflectance)


def _matt_radiance(scene: Scene, reflectance: float) -> float:
    """Radiance of a matt surface on the table, for irradiance 1 at normal incidence."""
    cos_i = max(0.0, float(np.cos(np.radians(scene.seen_angles().theta_i))))
    return reflectance / np.pi * (cos_i + scene.rig.simulation.wall_light)


def _surface_radiance(scene: Scene, projection: _Projection) -> FloatImage:
    """Radiance of the surface over the outline's crop, for irradiance 1 at normal incidence."""
    outline = projection.outline
    rows, columns = outline.fraction.shape
    grid_x, matrix_x = _chebyshev_grid(columns)
    grid_y, matrix_y = _chebyshev_grid(rows)
    columns_px, rows_px = np.meshgrid(outline.column + grid_x, outline.row + grid_y)
    pixels: FloatArray = np.stack([columns_px, rows_px], axis=-1)
    to_plane: FloatArray = np.linalg.inv(projection.table).astype(np.float64)
    points_mm = apply_homography(to_plane, pixels)
    levels = [
        (matrix_y @ _radiance_at(part, points_mm).astype(np.float32)) @ matrix_x.T
        for part in _parts(scene)
    ]
    smooth: FloatImage = levels[0]
    if len(levels) > 1:
        smooth = blended(levels, _share(scene, projection)).astype(np.float32)
    if scene.mounted == "sample" and scene.sample.mottling > 0:
        smooth *= 1 + _texture(scene, projection)
    elif scene.mounted in BOARD_PLACES:
        smooth *= print_on(scene.board, projection.homography, outline)
    return smooth


def _parts(scene: Scene) -> list[Scene]:
    """The scene with the parameters of each part of its sample."""
    if scene.mounted != "sample" or scene.sample.variation is None:
        return [scene]
    parts = []
    for share in shares_to_render(scene.sample.variation):
        part = copy(scene)
        part.sample = scene.sample.with_share(share)
        parts.append(part)
    return parts


def _share(scene: Scene, projection: _Projection) -> FloatArray:
    """Share of the sample's other parameters over the outline's crop."""
    variation, crop = scene.sample.variation, projection.outline.crop
    assert variation is not None
    if variation.pattern != "gradient":
        camera, corners = scene.rig.camera, region_mm(variation, scene.sample_size)
        outline = apply_homography(projection.homography, corners)
        region = polygon_coverage(outline, camera.width_px, camera.height_px)
        whole = np.zeros((camera.height_px, camera.width_px))
        whole[region.crop] = region.fraction
        return whole[crop]
    columns, rows = np.meshgrid(*(np.arange(s.start, s.stop) for s in crop[::-1]))
    to_surface = np.linalg.inv(projection.homography).astype(np.float64)
    points_mm = apply_homography(to_surface, np.stack([columns, rows], axis=-1))
    return share_at(points_mm, variation, scene.sample_size)


def _chebyshev_grid(pixels: int) -> tuple[FloatArray, FloatImage]:
    """Chebyshev points over `pixels` pixels, and the interpolation matrix (pixels, nodes)."""
    points = chebyshev.chebpts1(_NODES).astype(np.float64)
    half = max(pixels - 1, 1) / 2
    to_coefficients = np.linalg.inv(chebyshev.chebvander(points, _NODES - 1))
    basis = chebyshev.chebvander(np.arange(pixels) / half - 1, _NODES - 1)
    return (points + 1) * half, (basis @ to_coefficients).astype(np.float32)


def _radiance_at(scene: Scene, points_mm: FloatArray) -> FloatArray:
    """Radiance at points (..., 2) of the table, at the surface's height, seen from the lens."""
    seen, simulation = scene.seen_angles(), scene.rig.simulation
    points_mm = turned(points_mm, seen.turn_deg)
    height = np.full(points_mm.shape[:-1], scene.heights_mm[scene.mounted or "sample"])
    flat = np.dstack([points_mm, height]).reshape(-1, 3)
    angles = (seen.theta_i, seen.theta_r, seen.dphi)
    values = radiance(scene.seen_brdf(), flat, *angles, _acceptance(scene), _rings(scene))
    values *= beam_profile(flat, seen.theta_i, seen.dphi, simulation.lamp_defects)
    values += wall_radiance(scene.brdf(), seen.theta_r, simulation.wall_light)
    return values.reshape(points_mm.shape[:-1])


def _acceptance(scene: Scene) -> Acceptance:
    return Acceptance.of(scene.rig, scene.patch)


def _rings(scene: Scene) -> int:
    """Number of rings over which lamp and lens must be averaged.

    The largest number that any whole degree within 1 degree of the view angle needs; computed once
    for each place of the lamp.
    """
    seen = scene.in_plane_angles()  # a lean across hardly matters, and would change with theta_r
    theta_i, dphi = seen.theta_i, seen.dphi
    key = (scene.mounted or "", theta_i, dphi)
    if key not in scene.rings:
        acceptance = _acceptance(scene)
        scene.rings[key] = required_rings(scene.brdf(), theta_i, _VIEW_ANGLES_DEG, dphi, acceptance)
    near = np.abs(_VIEW_ANGLES_DEG - seen.theta_r) <= 1.0
    return int(scene.rings[key][near].max(initial=1))


def _texture(scene: Scene, projection: _Projection) -> FloatImage:
    """Relative albedo texture of the sample over the outline's crop."""
    texture, spacing_mm = scene.mottling()
    rows, columns = texture.shape
    outline = projection.outline
    texel_to_mm = np.array(
        [
            [spacing_mm, 0, -spacing_mm * (columns - 1) / 2],
            [0, spacing_mm, -spacing_mm * (rows - 1) / 2],
            [0, 0, 1.0],
        ]
    )
    to_crop = np.array([[1, 0, -outline.column], [0, 1, -outline.row], [0, 0, 1.0]])
    height, width = outline.fraction.shape
    warped = cv2.warpPerspective(
        texture.astype(np.float32),
        to_crop @ projection.homography @ texel_to_mm,
        (width, height),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REFLECT,
    )
    return np.asarray(warped, dtype=np.float32)


@lru_cache(maxsize=4)
def _response(pinhole: Pinhole, white_electrons_per_s: float, lens: LensDefects) -> FloatImage:
    """Electrons per second per unit radiance: white at normal incidence is 1/pi; times cos^4."""
    rows, columns = np.ogrid[: pinhole.height_px, : pinhole.width_px]
    falloff = pinhole.cos4(columns, rows)
    if lens.vignetting:
        falloff *= transmission((pinhole.height_px, pinhole.width_px), lens)
    return (np.pi * white_electrons_per_s * falloff).astype(np.float32)
