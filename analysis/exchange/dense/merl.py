"""MERL: isotropic BRDF on a dense grid of half-vector angles, as binary file, for renderers.

Layout: three int32 (90, 90, 180), then the planes R, G, B of float64, little-endian, with the cell
phi_d + 180 (theta_d + 90 theta_h). Cell i of theta_h stands for i^2/90 degrees, of theta_d and
phi_d for i degrees; a reader multiplies the planes by 1/1500, 1.15/1500 and 1.66/1500. A negative
value marks a cell without one. Source: W. Matusik, H. Pfister, M. Brand, L. McMillan, "A
Data-Driven Reflectance Model", SIGGRAPH (2003), and the reader published with its data; angles:
S. Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation", EGWR (1998).

Azimuth: phi_d is that of the source about the half-vector, 0 where it lies in the plane of
half-vector and normal, on the normal's far side. A sweep through the source has phi_d = 0 or 180.

The three planes hold the same reflectance: one camera without a colour filter measured it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.exchange.exported import Export, ExportedModel
from analysis.exchange.resampling import (
    beyond_measured,
    model_valid,
    require_resampling,
    side_file,
)
from instrument.geometry import BoolArray, FloatArray, Geometry

T = TypeVar("T", bound=np.generic)

NAME = "merl"
SHAPE = (90, 90, 180)
SCALES = (1 / 1500, 1.15 / 1500, 1.66 / 1500)
EMPTY = -1.0
_HORIZON = 1e-9  # smallest cosine of a direction that is above the surface
_NOTE = (
    "Every value of the .binary file is modelled: the run was resampled through the fitted model. "
    "Cells hold the value at their lower edge, the same in all three planes; negative ones have "
    "none: below the horizon, or where the model is not valid."
)


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of the binary file and of the side file that explains it."""
    model = require_resampling(export, NAME)
    geometry, above = _cells()
    value = _values(model, geometry)
    cells = {
        "below_horizon": ~above,
        "model_not_valid": _spread(value < 0, above),
        "beyond_measured_angles": _spread(
            beyond_measured(export.table, geometry) & (value >= 0), above
        ),
    }
    counts = {name: int(np.sum(_mirrored(mask))) for name, mask in cells.items()}
    half = np.full(above.shape, EMPTY)
    half[above] = value
    plane = _mirrored(half)
    planes = [np.where(plane < 0, EMPTY, plane / scale).astype("<f8") for scale in SCALES]
    yield (
        f"{stem}.binary",
        np.array(SHAPE, dtype="<i4").tobytes() + b"".join(p.tobytes() for p in planes),
    )
    all_cells = {"all": int(np.prod(SHAPE)), **counts}
    yield side_file(export, model, f"{stem}.{NAME}", _NOTE, {"cells": all_cells})


def _values(model: ExportedModel, geometry: Geometry) -> FloatArray:
    """BRDF (N,) in 1/sr, `EMPTY` where the model gives none."""
    value = model.brdf(geometry)
    usable = model_valid(model, geometry) & np.isfinite(value) & (value >= 0)
    return np.where(usable, value, EMPTY)


def _cells() -> tuple[Geometry, BoolArray]:
    """Geometry (N,) in degrees of the cells above the horizon, and their mask (90, 90, 91).

    phi_d from 0 to 90 degrees: 180 - phi_d is the same reflection, by reciprocity and mirror
    symmetry.
    """
    n_half, n_diff, n_phi = SHAPE
    half, difference, phi = np.meshgrid(
        np.radians(np.arange(n_half) ** 2 / 90),
        np.radians(np.arange(n_diff)),
        np.radians(np.arange(n_phi // 2 + 1)),
        indexing="ij",
    )
    to_lamp, to_camera = directions(half, difference, phi)
    above = np.minimum(to_lamp[..., 2], to_camera[..., 2]) > _HORIZON
    return Geometry.from_directions(to_lamp[above], to_camera[above]), above


def _spread(mask: BoolArray, above: BoolArray) -> BoolArray:
    whole = np.zeros_like(above)
    whole[above] = mask
    return whole


def _mirrored(half: NDArray[T]) -> NDArray[T]:
    """Cells of all phi_d from those up to 90 degrees."""
    phi = np.arange(SHAPE[2])
    return half[..., np.minimum(phi, SHAPE[2] - phi)]


def directions(
    half: FloatArray, difference: FloatArray, phi: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (..., 3) to lamp and camera from theta_h, theta_d, phi_d (...) in radians."""
    along, across = np.sin(difference) * np.cos(phi), np.sin(difference) * np.sin(phi)
    up = np.cos(difference)
    cosine, sine = np.cos(half), np.sin(half)
    to_lamp = [cosine * along + sine * up, across, cosine * up - sine * along]
    to_camera = [sine * up - cosine * along, -across, cosine * up + sine * along]
    return np.stack(to_lamp, axis=-1), np.stack(to_camera, axis=-1)
