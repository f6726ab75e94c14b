"""BRDF of each cell, by the relation that turned the window's mean of a reading into its BRDF.

A reading's BRDF is its count, less stray light, times a factor: exposure, drift, white tile, and
what the rig file corrects. The same offset and factor hold for each of its cells, so that every
correction of the run is in the map, and none twice. The lamp is near: the light on each cell is
that of a point at its distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.measure.rectify.cell_grid import CellGrid
from acquisition.measure.rectify.rectified import LEAST_SHARE, off_edge, sampling
from acquisition.results.maps.kept_cells import CellLight
from acquisition.results.maps.mean_curve import MeanCurve
from acquisition.results.maps.surface_height import Height
from acquisition.results.maps.vignetting import Vignetting
from analysis.sample_maps.block_fit import CellData
from analysis.sample_maps.places import Places
from instrument.config.load import Loaded
from instrument.config.rig import Rig
from instrument.geometry import BoolArray, FloatArray, camera_direction, lamp_direction
from instrument.pinhole import Pinhole
from instrument.record.reading import Reading

_MOST_DEG = 88.0  # from the normal, of lamp and camera: beyond, a cell may see neither
_NEAREST = 5  # pictures nearest to the normal, which show the texture
_U_HEIGHT_MM, _U_PIXELS = 0.02, 0.05  # of a cell's place (assumed)
_BESIDE = 0.4  # mean of the positive part of a normal deviate: 1 / sqrt(2 pi)
_PARTS = 9  # of the patch, along a side
_ROUNDING_DN2 = 1 / 12  # variance of a count's rounding


def usable(readings: Sequence[Reading], grid: CellGrid, rig: Rig) -> BoolArray:
    """Return True for each reading (K,) whose view angle resolves the cells, and that has light."""
    pinhole = Pinhole.of(rig)
    return np.array(
        [
            max(r.theta_i_deg, abs(r.theta_r_deg)) <= _MOST_DEG
            and r.signal_dn > 0
            and sampling(grid, pinhole, r.theta_r_deg).share >= LEAST_SHARE
            for r in readings
        ],
        dtype=bool,
    )


def places_of(readings: Sequence[Reading], rig: Rig, height_mm: float = 0.0) -> Places:
    """Return the positions of lamp and camera, (K, 3) in mm, over a surface at that height."""
    theta_i, dphi, theta_r = (
        np.array([getattr(r, name) for r in readings])
        for name in ("theta_i_deg", "dphi_deg", "theta_r_deg")
    )
    lowered = np.array([0.0, 0.0, height_mm])
    return Places(
        rig.lamp_distance_mm * lamp_direction(theta_i, dphi) - lowered,
        rig.beam_length_mm * camera_direction(theta_r) - lowered,
    )


def cell_data(
    light: CellLight, readings: Sequence[Reading], curve: MeanCurve, grid: CellGrid, loaded: Loaded
) -> CellData:
    """Return the BRDF of the cells in K readings, as if all had the light that the axis has.

    With its variance; `light` is changed. curve: of the same readings.
    """
    rig, count = loaded.rig, len(readings)
    signal = np.array([r.signal_dn for r in readings])
    factor = curve.brdf / signal
    # The tile's mean, as that of the sample, is over a patch that the lamp lights unevenly.
    factor *= _light_on_patch(readings, loaded)
    brdf, offset = light.cells, signal - light.window
    vignetting = Vignetting(rig, loaded.protocol.window)
    for k, reading in enumerate(readings):
        brdf[k] += np.float32(offset[k])
        brdf[k] *= np.float32(factor[k])
        vignetting.take_out(brdf[k], grid, reading.theta_r_deg)
    leave_out_edges(brdf, readings, grid, loaded)
    noise = np.empty(count)
    for k, reading in enumerate(readings):
        seen = sampling(grid, Pinhole.of(rig), reading.theta_r_deg)
        noise[k] = seen.noise / seen.share**2
    frames = np.array([r.frames for r in readings])
    floor, per_dn = pixel_variance(frames, loaded)
    return CellData(
        brdf=brdf,
        x_mm=grid.x_mm,
        y_mm=grid.y_mm,
        floor=factor**2 * noise * light.smoothing * floor,
        per_brdf=factor * noise * light.smoothing * per_dn,
        relative=curve.u_own,
    )


def _light_on_patch(readings: Sequence[Reading], loaded: Loaded) -> FloatArray:
    """Return the mean light on the measured patch, (K,), relative to that on the axis."""
    patch, part = loaded.protocol.window, (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    places = places_of(readings, loaded.rig)
    light = places.irradiance(patch.width_mm * part, patch.height_mm * part)
    return np.asarray(light.mean(axis=(1, 2)))


def pixel_variance(frames: FloatArray, loaded: Loaded) -> tuple[FloatArray, FloatArray]:
    """Return variance (K,) of a pixel's light without light, in DN^2, and its rise with it, in DN.

    frames: (K,), averaged in each reading. Photons, read-out, rounding, and the dark.
    """
    camera, darks = loaded.rig.camera, loaded.protocol.dark_frames
    gain = camera.electrons_per_dn
    black = (camera.read_noise_electrons / gain) ** 2 + _ROUNDING_DN2
    return black * (1 / frames + 1 / darks), 1 / (gain * frames)


def in_own_light(
    data: CellData, readings: Sequence[Reading], height: Height, blur: FloatArray, rig: Rig
) -> CellData:
    """Return the cells, in 1/sr, of a surface at a height, each divided by its own light, in place.

    With what their places, and neighbours that are mixed in, may change. blur: (K,), as
    `CellLight.blur`.
    """
    for k, reading in enumerate(readings):
        on_axis = places_of([reading], rig)
        light = places_of([reading], rig, height.mm).irradiance(data.x_mm, data.y_mm)[0]
        light *= float(_light_at_height(on_axis, height.mm))
        data.brdf[k] /= light.astype(np.float32)
    theta_r_deg = np.array([r.theta_r_deg for r in readings])
    cell_mm = abs(float(data.x_mm[1] - data.x_mm[0]))
    texture, bend = _texture(data.brdf, theta_r_deg, cell_mm)
    return replace(
        data,
        texture=texture,
        place_mm=_u_place_mm(theta_r_deg, height, rig),
        bend=bend,
        blur=blur + _pixel_blur(theta_r_deg, cell_mm, rig),
    )


def _texture(
    brdf: NDArray[np.float32], theta_r_deg: FloatArray, cell_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return the relative change of each cell's light along x, (rows, columns) each.

    For a mm, signed; and the difference of a cell from the mean of its two neighbours.
    """
    near = brdf[np.argsort(np.abs(theta_r_deg))[:_NEAREST]]
    known = np.isfinite(near)
    mean = np.where(known, near, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    level = np.where(mean > 0, mean, np.inf)
    bend = np.zeros(mean.shape)
    bend[:, 1:-1] = mean[:, 1:-1] - (mean[:, :-2] + mean[:, 2:]) / 2
    return np.asarray(np.gradient(mean, cell_mm, axis=1) / level), bend / level


def _u_place_mm(theta_r_deg: FloatArray, height: Height, rig: Rig) -> FloatArray:
    """Return the u (K,) in mm of the place that a cell has in each picture.

    By the surface's height, as well as a texture tells it, and by what the camera's pixels blur.
    """
    theta_r = np.radians(theta_r_deg)
    pixel_mm = rig.camera.field_width_mm / rig.camera.width_px
    u_mm = height.u_mm if np.isfinite(height.u_mm) else _U_HEIGHT_MM
    return np.hypot(u_mm * np.tan(theta_r), _U_PIXELS * pixel_mm / np.cos(theta_r))


def _pixel_blur(theta_r_deg: FloatArray, cell_mm: float, rig: Rig) -> FloatArray:
    """Return the share (K,) of the difference from neighbours that pixels blur, beyond the least.

    A pixel, and the interpolation between two, spread light with a variance of 1/12 and 1/6 of its
    width squared; a pixel's width on the sample grows with the view angle. Of a sharp edge beside a
    cell 0.4 of the standard deviation falls into it, and the difference is half of the edge. A
    smooth texture loses less.
    """
    pixel_mm = rig.camera.field_width_mm / rig.camera.width_px
    spread = pixel_mm / (2 * cell_mm * np.cos(np.radians(theta_r_deg)))
    return np.asarray(2 * _BESIDE * (spread - np.min(spread)))


def _light_at_height(places: Places, height_mm: float) -> float:
    """Return the light above the axis at a height, relative to that on it."""
    x, y, z = places.lamp_mm[0].tolist()
    nearer = (x * x + y * y + z * z) / (x * x + y * y + (z - height_mm) ** 2)
    return float((z - height_mm) / z * nearer**1.5)


def leave_out_edges(
    brdf: NDArray[np.float32], readings: Sequence[Reading], grid: CellGrid, loaded: Loaded
) -> None:
    """Set cells (K, rows, columns), in 1/sr or any unit, to NaN that the sample's edge may touch.

    Misplaced, or blurred by the pixels.
    """
    sample, rig = loaded.protocol.sample, loaded.rig
    pixel_mm = rig.camera.field_width_mm / rig.camera.width_px
    for k, reading in enumerate(readings):
        theta_r = np.radians(abs(reading.theta_r_deg))
        blur = pixel_mm / np.cos(theta_r) + 2 * rig.u_placement_mm * np.tan(theta_r)
        kept = off_edge(grid, (sample.width_mm, sample.height_mm), (float(blur), pixel_mm))
        brdf[k][kept == 0] = np.nan
