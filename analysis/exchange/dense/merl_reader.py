"""Reader of MERL files: a selection of geometries, interpolated between the cells of the grid.

The layout is that of `merl`. A file has 1 458 000 cells and no uncertainty; a fit needs some
hundred geometries, so sweeps through and across the plane of incidence are taken, closer together
about the mirror direction. A geometry that has a cell without a value beside it is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.data.measurements import Measurements
from analysis.exchange.dense.merl import SCALES, SHAPE
from instrument.errors import InputError
from instrument.geometry import FloatArray, Geometry

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue: ITU-R BT.709-6, item 3.2."""
THETA_I_DEG = (15.0, 30.0, 45.0, 60.0, 75.0)
STEP_DEG, LARGEST_DEG = 5.0, 80.0
NEAR_MIRROR_DEG = (1.0, 2.0, 3.0)

_HEADER = np.array(SHAPE, dtype="<i4").tobytes()
_CELLS = int(np.prod(SHAPE))
_BYTES = len(_HEADER) + 3 * 8 * _CELLS


@dataclass(frozen=True, slots=True)
class MerlTable:
    """Selected geometries with their luminance as BRDF; `without`: number of those left out.

    alike: red, green and blue hold the same values.
    """

    measurements: Measurements
    without: int
    alike: bool


def is_merl(path: Path) -> bool:
    """Return True for a file that begins as a MERL file does."""
    try:
        with path.open("rb") as file:
            return path.is_file() and file.read(len(_HEADER)) == _HEADER
    except OSError:
        return False


def read_merl(path: Path) -> MerlTable:
    """Read a file; raises `InputError` where it is none, or has no value at any geometry."""
    planes = _planes(path)
    geometry = selected_geometries()
    found = np.stack([_interpolated(plane, geometry) for plane in planes])
    brdf = np.tensordot(LUMINANCE, found, axes=1)
    kept = np.isfinite(brdf)
    if not np.any(kept):
        raise InputError(f"{path}: has no value at any of {kept.size} geometries: is it damaged?")
    angles = (geometry.theta_i_deg, geometry.theta_r_deg, geometry.dphi_deg)
    theta_i, theta_r, dphi = (a[kept] for a in angles)
    m = Measurements.bare(theta_i, theta_r, dphi, brdf[kept])
    return MerlTable(m, int(np.sum(~kept)), bool(np.allclose(found[:, kept], brdf[kept])))


def _planes(path: Path) -> FloatArray:
    """BRDF (3, 90, 90, 180) in 1/sr of red, green and blue; NaN where a cell has no value."""
    size = path.stat().st_size
    if size != _BYTES or not is_merl(path):
        raise InputError(
            f"{path}: {size} bytes; a MERL file has {_BYTES}: three int32 (90, 90, 180), then "
            f"3 x {_CELLS} float64"
        )
    values = np.fromfile(path, dtype="<f8", offset=len(_HEADER)).reshape(3, *SHAPE)
    if not np.all(np.isfinite(values)):
        bad = int(np.sum(~np.isfinite(values)))
        raise InputError(f"{path}: {bad} values are no finite numbers: it is damaged")
    return np.where(values < 0, np.nan, values * np.reshape(SCALES, (3, 1, 1, 1)))


def selected_geometries() -> Geometry:
    """Geometry (N,) in degrees of the sweeps that are taken from a file."""
    views = np.arange(-LARGEST_DEG, LARGEST_DEG + STEP_DEG / 2, STEP_DEG)
    near = np.array([*(-d for d in NEAR_MIRROR_DEG), *NEAR_MIRROR_DEG])
    rows = []
    for theta_i in THETA_I_DEG:
        mirror = -theta_i + near
        along = np.union1d(views, mirror[np.abs(mirror) <= LARGEST_DEG])
        rows += [(theta_i, theta_r, 0.0) for theta_r in along]
        rows += [(theta_i, theta_r, 90.0) for theta_r in views[views > 0]]  # symmetric
    theta_i, theta_r, dphi = np.array(rows).T
    return Geometry(theta_i, theta_r, dphi)


def _interpolated(plane: FloatArray, geometry: Geometry) -> FloatArray:
    """Values (N,) in 1/sr between the cells, linear along their indices."""
    from scipy.interpolate import RegularGridInterpolator

    half, difference, phi = half_angles_deg(geometry)
    # Reciprocity: phi_d and phi_d + 180 degrees are one reflection, so the first closes the turn.
    closed = np.concatenate([plane, plane[..., :1]], axis=-1)
    axes = (np.arange(SHAPE[0]), np.arange(SHAPE[1]), np.arange(SHAPE[2] + 1))
    at = np.stack([np.sqrt(90.0 * half), difference, np.mod(phi, 180.0)], axis=-1)
    inside = (at[:, 0] <= SHAPE[0] - 1) & (at[:, 1] <= SHAPE[1] - 1)
    values = np.full(half.shape, np.nan)
    values[inside] = RegularGridInterpolator(axes, closed)(at[inside])
    return values


def half_angles_deg(geometry: Geometry) -> tuple[FloatArray, FloatArray, FloatArray]:
    """theta_h, theta_d, phi_d (N,) in degrees of a geometry (Rusinkiewicz 1998, section 2)."""
    theta_i, theta_r, dphi = (
        np.radians(a) for a in (geometry.theta_i_deg, geometry.theta_r_deg, geometry.dphi_deg)
    )
    zero = np.zeros_like(theta_i)
    lamp = np.stack([np.sin(theta_i), zero, np.cos(theta_i)], axis=-1)
    camera = np.stack(
        [np.sin(theta_r) * np.cos(dphi), np.sin(theta_r) * np.sin(dphi), np.cos(theta_r)], axis=-1
    )
    half = lamp + camera
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    theta_h = np.arccos(np.clip(half[:, 2], -1.0, 1.0))
    around = np.arctan2(half[:, 1], half[:, 0])
    # The lamp in the frame of the half-vector: turned by -phi_h about z, then by -theta_h about y.
    x, y = lamp[:, 0] * np.cos(around), -lamp[:, 0] * np.sin(around)
    along = x * np.cos(theta_h) - lamp[:, 2] * np.sin(theta_h)
    up = x * np.sin(theta_h) + lamp[:, 2] * np.cos(theta_h)
    theta_d = np.arccos(np.clip(up, -1.0, 1.0))
    return np.degrees(theta_h), np.degrees(theta_d), np.degrees(np.arctan2(y, along))
