"""Effects of the lens and of the surroundings: vignetting, stray light, light from the walls."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from instrument.geometry import FloatArray, Geometry

VIGNETTING, STRAY, WALLS = "vignetting", "stray light", "light from the surroundings"

_POINTS = 3  # in the window, per side, over which stray light is averaged


def lens_effects(readings: Readings) -> Iterator[Effect]:
    """Yield the effects whose size or u the rig file states."""
    lines = readings.rig.uncertainty
    for key, name, by_one in (
        ("vignetting", VIGNETTING, _vignetting),
        ("stray_light", STRAY, _stray),
        ("wall_light", WALLS, _walls),
    ):
        size, u = getattr(lines, key), getattr(lines, f"u_{key}")
        if size or u:
            yield Effect(name=name, by_one=by_one(readings), size=size, u=u)


def _cos_view(readings: Readings, *, tile: bool) -> FloatArray:
    """Cosine of the view angle, (N,), of the points or of their tile's readings."""
    angle = readings.of_tiles("theta_r_deg") if tile else readings.of_points("theta_r_deg")
    return np.asarray(np.cos(np.radians(angle)))


def _px_per_mm(readings: Readings) -> float:
    camera = readings.rig.camera
    return camera.width_px / camera.field_width_mm


def _vignetting(readings: Readings) -> FloatArray:
    """Change, (N,), by the mean square distance from the picture's middle, beyond the tile's.

    The window narrows with the view angle; its place, and its height, are those of the tile.
    """
    camera, half_mm = readings.rig.camera, readings.protocol.window.width_mm / 2
    half_px = half_mm * _px_per_mm(readings) * _cos_view(readings, tile=False)
    diagonal_px = float(np.hypot(camera.width_px, camera.height_px)) / 2
    of_tile: FloatArray | float = 0.0
    if readings.absolute:
        of_tile = half_mm * _px_per_mm(readings) * _cos_view(readings, tile=True)
    return np.asarray((of_tile**2 - half_px**2) / (3 * diagonal_px**2))


def _stray(readings: Readings) -> FloatArray:
    """Change, (N,), by what the lens scatters away from the window and into it, beyond the tile's.

    The darker the surface beside its background, and the broader its picture, the less is lost.
    """
    sample, background = readings.protocol.sample, readings.rig.uncertainty.background_reflectance
    beside = np.zeros(len(readings.points))
    if readings.absolute:
        beside = background / (np.pi * np.maximum(readings.value, 1e-9))
    own = _scattered(readings, (sample.width_mm, sample.height_mm), beside, tile=False)
    tile = readings.protocol.references.white_tile
    if tile is None or not readings.absolute:
        return own
    size = (tile.width_mm or sample.width_mm, tile.height_mm or sample.height_mm)
    return own - _scattered(readings, size, np.full(own.size, background), tile=True)


def _scattered(
    readings: Readings, size_mm: tuple[float, float], beside: FloatArray, *, tile: bool
) -> FloatArray:
    """Change of the window's mean, (N,), if all light were scattered.

    `beside`: radiance of the background, (N,), relative to the surface's. Light from outside of the
    picture does not count: nothing is known about it.
    """
    rig, patch = readings.rig, readings.protocol.window
    width_px = rig.uncertainty.stray_light_width * rig.camera.width_px
    cos = _cos_view(readings, tile=tile)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    frame = np.array([rig.camera.width_px, rig.camera.height_px]) / 2
    found = np.zeros(cos.size)
    for x, weight_x in zip(nodes, weights / 2, strict=True):
        for y, weight_y in zip(nodes, weights / 2, strict=True):
            half = _px_per_mm(readings) / 2
            at = (x * patch.width_mm * half * cos, np.full(cos.size, y * patch.height_mm * half))
            surface = _share_within(at, (size_mm[0] * half * cos, size_mm[1] * half), width_px)
            whole = _share_within(at, (frame[0], frame[1]), width_px)
            found += weight_x * weight_y * (surface + (whole - surface) * beside - 1)
    return found


def _share_within(
    at: tuple[FloatArray, FloatArray],
    half: tuple[FloatArray | float, FloatArray | float],
    width_px: float,
) -> FloatArray:
    """Share of the light scattered at `at`, (N,) columns and rows, that stays in a rectangle.

    `half`: its half sides about the middle. Point spread w / (2 pi (r^2 + w^2)^1.5): the share is
    the solid angle of the rectangle from a height of w, over 2 pi.
    """
    share = np.zeros(at[0].size)
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            x, y = half[0] + side_x * at[0], half[1] + side_y * at[1]
            share += np.arctan2(x * y, width_px * np.sqrt(x**2 + y**2 + width_px**2))
    return share / (2 * np.pi)


def _walls(readings: Readings) -> FloatArray:
    """Change, (N,), by light from all directions, beyond that of a matt tile.

    How much of it the surface reflects to the camera is known from a quick fit. With too few points
    for one it is as much as the median of the values says.
    """
    theta_i, theta_r, dphi = readings.angles_deg()
    fit, value = readings.fit, readings.value
    usual: FloatArray | float = float(np.nanmedian(value))
    if fit is not None:
        usual = fit.hemisphere_mean(theta_r)
        if not readings.absolute:  # each setting of the lamp has a unit of its own
            geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
            value = fit.values(geometry)
    return (usual / np.maximum(value, 1e-3 * usual) - 1) / np.cos(np.radians(theta_i))
