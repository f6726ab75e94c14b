"""Photometric stereo: what a wrong reflectance model costs in normals and depth.

What to use when: `two_lamps` for the cross-section of a cylinder, as Oren and Nayar 1995 (section
6.3) reconstruct their vase from lamps 10 degrees to either side of the camera; `three_lamps` for a
whole surface.

The brightness of a place under each lamp in turn gives its normal, by ratios: its albedo and the
exposure need not be known. Lambert's law solves for the normal in closed form (Woodham 1980); the
fitted model is searched for the normal whose ratios are nearest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.rendering.cross_section import across
from analysis.rendering.light import light
from analysis.rendering.material import Material
from analysis.rendering.render import radiance, render
from analysis.rendering.shadows import lit
from analysis.rendering.surface import Surface, unit
from instrument.geometry import BoolArray, FloatArray, IntArray

ASIDE_DEG = 10.0
"""Lamps from the viewer, as in the paper."""

REACH_DEG = 70.0
"""Steepest normals that count, from the viewer."""

_SEED = 1995
_REPEATS = 8  # of the cross-section, each with noise of its own
_TABLE_STEP_DEG, _TABLE_REACH_DEG = 1.0, 85.0
_FINE = 10  # steps of the search in one of the table
_LEVEL = 0.3  # relative u of the albedo in the search: tells apart normals of nearly equal ratios
_LEAST_NOISE = 1e-4
_AZIMUTHS_DEG = (90.0, 210.0, 330.0)
_SPIRAL = 20_000  # normals in the table of a whole surface: 0.7 degrees apart
_AT_A_TIME = 256  # brightnesses compared with the whole table


@dataclass(frozen=True, slots=True, eq=False)
class Recovered:
    """Surface as found from pictures, by one law of reflection.

    normals_off_deg: angle between the normals found and the true ones, rms over all places. depth:
    relief found over the true one. heights: across the middle, from the first place on (N,), in
    radii of the vase.
    """

    normals_off_deg: float
    depth: float
    heights: FloatArray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Stereo:
    """Outcome of one stereo: by Lambert's law, and by the material's own model.

    places: x (N,) across the middle; heights: the true ones there (N,), both in radii of the vase.
    lamps: their number. noise: relative u of the brightest pixel.
    """

    places: FloatArray
    heights: FloatArray
    by_lambert: Recovered
    by_model: Recovered
    lamps: int
    noise: float

    def sentence(self) -> str:
        """Return what Lambert's law costs, and what the model finds."""
        lambert, model = self.by_lambert, self.by_model
        lamps = f"two lamps {ASIDE_DEG:g}° to either side of the camera"
        if self.lamps > 2:
            lamps = f"{self.lamps} lamps {ASIDE_DEG:g}° from the camera, all around"
        return (
            "What Lambert’s law would cost: photometric stereo of a vase of this material, with "
            f"{lamps}, is off by {lambert.normals_off_deg:.1f}° (rms) in the normals and finds "
            f"{lambert.depth:.2f} of the depth; by this model it is off by "
            f"{model.normals_off_deg:.1f}° and finds {model.depth:.2f}."
        )


def two_lamps(material: Material, noise: float = 0.0) -> Stereo:
    """Recover the cross-section of a cylinder from lamps at 10 degrees to its left and its right.

    noise: relative u of the brightest pixel; that of others follows from counted photons.
    """
    lamps = [light(-ASIDE_DEG), light(ASIDE_DEG)]
    angles = np.arange(-REACH_DEG, REACH_DEG + 0.5)
    nodes = np.arange(-_TABLE_REACH_DEG, _TABLE_REACH_DEG + 0.5, _TABLE_STEP_DEG)
    table = np.stack([across(material, [lamp], nodes) for lamp in lamps])
    seen = np.stack([np.interp(angles, nodes, row) for row in table])
    noisy = _noisy(np.repeat(seen[:, None], _REPEATS, axis=1), noise)
    tilt = (noisy[1] - noisy[0]) / (noisy.sum(axis=0) * np.tan(np.radians(ASIDE_DEG)))
    fine = np.linspace(nodes[0], nodes[-1], (nodes.size - 1) * _FINE + 1)
    known = np.stack([np.interp(fine, nodes, row) for row in table])
    found = fine[_nearest(known, noisy.reshape(2, -1), noise)].reshape(_REPEATS, -1)
    places, lambert = np.sin(np.radians(angles)), np.degrees(np.arctan(tilt))
    truth = _heights(places, _slopes(angles))
    return Stereo(
        places=places,
        heights=truth,
        by_lambert=_of_section(places, angles, truth, lambert),
        by_model=_of_section(places, angles, truth, found),
        lamps=2,
        noise=noise,
    )


def three_lamps(material: Material, surface: Surface, noise: float = 0.0) -> Stereo:
    """Recover a surface (R, C) from three lamps at 10 degrees from the viewer, all around.

    noise: relative u of the brightest pixel. Places count that all lamps light, with normals within
    70 degrees of the viewer. Heights are in units of the vase's radius.
    """
    lamps = [light(ASIDE_DEG, azimuth) for azimuth in _AZIMUTHS_DEG]
    facing = surface.normal[..., 2] >= np.cos(np.radians(REACH_DEG))
    used = np.logical_and.reduce([facing, *(lit(surface, lamp) for lamp in lamps)])
    seen = np.stack([render(surface, material, [lamp])[used] for lamp in lamps])
    noisy, truth = _noisy(seen, noise), surface.normal[used]
    directions = np.stack([lamp.direction for lamp in lamps])
    lambert = unit(np.asarray(np.linalg.solve(directions, noisy).T, dtype=np.float64))
    table = _cap()
    known = np.stack([radiance(table, material, [lamp]) for lamp in lamps])
    model = table[_nearest(known, noisy, noise)]
    middle = used.shape[0] // 2
    columns = np.flatnonzero(used[middle])
    return Stereo(
        places=surface.x[columns],
        heights=_row_heights(surface, used, truth)[middle][columns],
        by_lambert=_of_surface(surface, used, truth, lambert),
        by_model=_of_surface(surface, used, truth, model),
        lamps=3,
        noise=noise,
    )


def _cap() -> FloatArray:
    """Unit normals (N, 3) evenly spread within some degrees of the viewer, on a golden spiral."""
    lowest = np.cos(np.radians(_TABLE_REACH_DEG - 5))
    count = np.arange(_SPIRAL) + 0.5
    z = 1 - (1 - lowest) * count / _SPIRAL
    azimuth = np.pi * (1 + np.sqrt(5)) * count
    across_z = np.sqrt(1 - z * z)
    return np.stack([across_z * np.cos(azimuth), across_z * np.sin(azimuth), z], axis=-1)


def _of_surface(
    surface: Surface, used: BoolArray, truth: FloatArray, found: FloatArray
) -> Recovered:
    """Compare normals found (N, 3) at the used pixels with the true ones."""
    cosine = np.clip(np.sum(truth * found, axis=1), -1, 1)
    off = float(np.degrees(np.sqrt(np.mean(np.arccos(cosine) ** 2))))
    true, own = (_row_heights(surface, used, normals) for normals in (truth, found))
    rows = np.flatnonzero(used.sum(axis=1) > 1)
    relief = [np.sum([np.ptp(map_[row][used[row]]) for row in rows]) for map_ in (own, true)]
    middle = used.shape[0] // 2
    return Recovered(off, float(relief[0] / relief[1]), own[middle][used[middle]])


def _row_heights(surface: Surface, used: BoolArray, normals: FloatArray) -> FloatArray:
    """Heights (R, C) from normals (N, 3) of the used pixels, along each row from its first one."""
    slope = np.zeros(used.shape)
    # A normal that noise has turned away from the viewer counts as one that it can just see.
    slope[used] = -normals[:, 0] / np.maximum(normals[:, 2], np.cos(np.radians(89)))
    found = np.zeros(used.shape)
    for row in np.flatnonzero(used.any(axis=1)):
        at = np.flatnonzero(used[row])
        found[row, at] = _heights(surface.x[at], slope[row, at])
    return found


def _of_section(
    places: FloatArray, angles: FloatArray, truth: FloatArray, found: FloatArray
) -> Recovered:
    """Compare angles found (repeats, N) in degrees with the true ones (N,)."""
    heights = np.stack([_heights(places, _slopes(row)) for row in found])
    relief = np.mean(np.ptp(heights, axis=1)) / np.ptp(truth)
    off = float(np.sqrt(np.mean((found - angles) ** 2)))
    return Recovered(off, float(relief), heights[0])


def _slopes(angles_deg: FloatArray) -> FloatArray:
    """Slopes dz/dx (N,) of normals so many degrees to the right of the viewer."""
    return np.asarray(-np.tan(np.radians(angles_deg)))


def _heights(places: FloatArray, slope: FloatArray) -> FloatArray:
    """Heights (N,) at places x (N,) from the slopes there, by the trapezoidal rule."""
    steps = (slope[1:] + slope[:-1]) / 2 * np.diff(places)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _noisy(seen: FloatArray, noise: float) -> FloatArray:
    """Brightness with noise whose variance is proportional to it, as of photons; above 0."""
    peak = float(np.max(seen))
    draws = np.random.default_rng(_SEED).standard_normal(seen.shape)
    return np.maximum(seen + noise * np.sqrt(seen * peak) * draws, 1e-6 * peak)


def _nearest(known: FloatArray, seen: FloatArray, noise: float) -> IntArray:
    """Entry (N,) of the table whose ratios are nearest, for each of the brightnesses seen.

    known: (lamps, P). seen: (lamps, N). Their sum counts as little as an albedo known to 30 %.
    """
    scale = max(noise, _LEAST_NOISE)

    def features(brightness: FloatArray) -> FloatArray:
        total = brightness.sum(axis=0)
        shares = brightness[1:] / total / scale
        return np.concatenate([shares, np.log(total)[None] / _LEVEL]).T

    usable = np.flatnonzero(np.all(known > 0, axis=0))
    table = features(known[:, usable])
    squares, at = np.sum(table**2, axis=1), []
    for few in np.array_split(features(seen), -(-seen.shape[1] // _AT_A_TIME)):
        at.append(np.argmin(squares - 2 * few @ table.T, axis=1))
    return np.asarray(usable[np.concatenate(at)])
