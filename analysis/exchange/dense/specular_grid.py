"""Grid about the specular direction: measured values on its nodes, and what lies between them.

A node is an incidence, an azimuth about the specular direction (0 towards the normal and the
lamp's side, 180 away from it) and a radial angle from the specular direction. The sample is taken
as isotropic: directions on both sides of the plane of incidence are put together.

- A scan in the plane of incidence has the azimuths 0 and 180, and the radial angles that were
  measured. Gaps are bridged linearly.
- Other scans have azimuths every 10 degrees and radial angles every 5 degrees besides those
  measured in the plane; between measured directions the value is linear on an equal-area map.

Each value carries a mark. A node that is farther than FARTHEST_DEG from every measured direction is
refused, as nothing is known of it. Below the horizon values go on: a reader that interpolates
between nodes on both sides of it would find too little light above it if they ended in 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from analysis.exchange.exported import BrdfTable, refuse
from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

MEASURED, INTERPOLATED, HELD, BELOW = "m", "i", "h", "-"
MARKS = {
    MEASURED: "measured",
    INTERPOLATED: "interpolated between measured values",
    HELD: "held at the nearest measured value",
    BELOW: "below the horizon, where the nearest measured value goes on",
}

# A scan to 75 degrees at azimuths every 30 leaves 21 degrees to grazing between two of them; a
# camera hides the lamp for 5 to 10 degrees to either side.
FARTHEST_DEG = 25.0
_SAME_DEG = 1e-6  # of one direction in two computations
_AZIMUTH_STEP_DEG, _RADIAL_STEP_DEG = 10.0, 5.0
_MOST_RADIALS = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecularGrid:
    """Values (I, A, R) in 1/sr and their marks (I, A, R), one letter of MARKS each.

    theta_i_deg (I,), azimuth_deg (A,) from 0 to 180, radial_deg (R,): axes, in degrees, ascending.
    """

    theta_i_deg: FloatArray
    azimuth_deg: FloatArray
    radial_deg: FloatArray
    brdf: FloatArray
    marks: np.ndarray[tuple[int, ...], np.dtype[np.str_]]


def directions(theta_i_deg: float, azimuth_deg: FloatArray, radial_deg: FloatArray) -> FloatArray:
    """Return unit vectors (..., 3) of nodes (...), in degrees; z the normal, the lamp on x > 0."""
    theta_i, azimuth, radial = (np.radians(a) for a in (theta_i_deg, azimuth_deg, radial_deg))
    specular = np.array([-np.sin(theta_i), 0.0, np.cos(theta_i)])
    to_normal = np.array([np.cos(theta_i), 0.0, np.sin(theta_i)])
    across = np.sin(radial) * np.sin(azimuth)
    vectors: FloatArray = (
        np.cos(radial)[..., None] * specular
        + (np.sin(radial) * np.cos(azimuth))[..., None] * to_normal
        + across[..., None] * np.array([0.0, 1.0, 0.0])
    )
    return vectors


def specular_grid(table: BrdfTable, format_name: str) -> SpecularGrid:
    """Return the grid of a table; raises `InputError` where nothing is known of a node."""
    angles = table.geometry
    theta_i = np.unique(angles.theta_i_deg)
    plane = _in_plane(angles)
    radial = _radials(angles, plane, format_name)
    flat = bool(np.all(plane))
    azimuth = np.array([0.0, 180.0]) if flat else np.arange(0.0, 180.1, _AZIMUTH_STEP_DEG)
    azimuths, radials = np.meshgrid(azimuth, radial, indexing="ij")
    layers = [_layer(table, float(t), azimuths, radials, format_name) for t in theta_i]
    return SpecularGrid(
        theta_i_deg=theta_i,
        azimuth_deg=azimuth,
        radial_deg=radial,
        brdf=np.array([brdf for brdf, _ in layers]),
        marks=np.array([marks for _, marks in layers]),
    )


def total_scatter(grid: SpecularGrid) -> FloatArray:
    """Return the reflected fraction (I,) of each incidence, a ratio, by integration of the grid."""
    fine_r = np.arange(0.25, grid.radial_deg[-1], 0.5)
    fine_a = np.arange(1.0, 180.0, 2.0)
    azimuth, radial = np.meshgrid(fine_a, fine_r, indexing="ij")
    patch = np.sin(np.radians(radial)) * np.radians(0.5) * np.radians(2.0)
    totals = []
    for theta_i, brdf in zip(grid.theta_i_deg, grid.brdf, strict=True):
        along = np.array([np.interp(fine_r, grid.radial_deg, row) for row in brdf])
        fine = np.array([np.interp(fine_a, grid.azimuth_deg, column) for column in along.T]).T
        height = np.maximum(directions(float(theta_i), azimuth, radial)[..., 2], 0.0)
        totals.append(2 * np.sum(fine * height * patch))  # both sides of the plane of incidence
    return np.array(totals)


def _in_plane(angles: Geometry) -> BoolArray:
    """True for points (N,) in the plane of incidence."""
    across = np.sin(angles.theta_r) * np.sin(np.radians(angles.dphi_deg))
    return np.asarray(np.abs(across) < np.radians(_SAME_DEG))


def _radials(angles: Geometry, plane: BoolArray, format_name: str) -> FloatArray:
    """Radial angles (R,) in degrees: those measured in the plane, and a regular set beside them."""
    end = 90.0 + float(angles.theta_i_deg.max())
    side = np.where(angles.cos_dphi > 0, 1.0, -1.0)
    offsets = np.abs(angles.theta_i_deg + side * angles.theta_r_deg)[plane]
    regular = np.arange(0.0, 0.0 if np.all(plane) else end, _RADIAL_STEP_DEG)
    radials = np.unique(np.round(np.concatenate([[0.0, end], offsets, regular]), 9))
    if radials.size > _MOST_RADIALS:
        refuse(
            format_name,
            f"has one list of angles from the specular direction for all incidences, and this scan "
            f"has {radials.size}, more than {_MOST_RADIALS}",
            "choose theta_i and theta_r in steps that fit together, or export as astm",
        )
    return radials


def _layer(
    table: BrdfTable, theta_i: float, azimuth: FloatArray, radial: FloatArray, format_name: str
) -> tuple[FloatArray, np.ndarray[tuple[int, ...], np.dtype[np.str_]]]:
    """Values and marks (A, R) of one incidence, for nodes (A, R)."""
    nodes = directions(theta_i, azimuth, radial)
    above = nodes[..., 2] > -np.radians(_SAME_DEG)
    known, values = _measured(table, theta_i)
    away_deg, nearest = _nearest(known, nodes)
    worst = np.unravel_index(np.argmax(np.where(above, away_deg, 0.0)), above.shape)
    if above[worst] and away_deg[worst] > FARTHEST_DEG:
        _refuse_sparse(theta_i, nodes[worst], float(away_deg[worst]), values.size, format_name)
    found = np.full(above.shape, np.nan)
    if azimuth.shape[0] == 2:
        found[above] = _along_the_plane(known, values, nodes[above])
    else:
        found[above] = _on_the_map(known, values, nodes[above])
    held = ~np.isfinite(found)
    exact = away_deg <= _SAME_DEG
    marks = np.where(held, HELD, INTERPOLATED)
    marks[~above] = BELOW
    marks[exact] = MEASURED
    return np.where(exact | held, values[nearest], found), marks


def _measured(table: BrdfTable, theta_i: float) -> tuple[FloatArray, FloatArray]:
    """Directions (M, 3) with y >= 0 and values (M,) of one incidence; repeats are averaged."""
    angles, points = table.geometry, table.geometry.theta_i_deg == theta_i
    theta_r, dphi = angles.theta_r[points], np.radians(angles.dphi_deg[points])
    vectors = np.stack(
        [np.sin(theta_r) * np.cos(dphi), np.abs(np.sin(theta_r) * np.sin(dphi)), np.cos(theta_r)],
        axis=-1,
    )
    keys = np.round(vectors / np.radians(_SAME_DEG))
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    means = np.bincount(group, weights=table.brdf[points]) / np.bincount(group)
    alone = np.bincount(group) == 1  # a mean of one may differ in the last digit
    means[alone] = table.brdf[points][first[alone]]
    return vectors[first], means


def _nearest(known: FloatArray, nodes: FloatArray) -> tuple[FloatArray, IntArray]:
    """Angle in degrees from each node (A, R, 3) to the nearest known (M, 3), and its index."""
    from scipy.spatial import cKDTree

    chord, index = cKDTree(known).query(nodes)
    return np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1.0))), np.asarray(index)


def _along_the_plane(known: FloatArray, values: FloatArray, nodes: FloatArray) -> FloatArray:
    """Values of nodes (N, 3) in the plane, linear in the angle; NaN beyond the last."""
    at, wanted = (np.degrees(np.arctan2(v[:, 0], v[:, 2])) for v in (known, nodes))
    order = np.argsort(at)
    return np.interp(wanted, at[order], values[order], left=np.nan, right=np.nan)


def _on_the_map(known: FloatArray, values: FloatArray, nodes: FloatArray) -> FloatArray:
    """Values of nodes (N, 3), linear on the equal-area map of the hemisphere; NaN outside."""
    from scipy.interpolate import LinearNDInterpolator

    both = np.concatenate([known, known * [1, -1, 1]])
    flat, wanted = (v[:, :2] / np.sqrt(1 + v[:, 2:]) for v in (both, nodes))
    place, first = np.unique(np.round(flat, 9), axis=0, return_index=True)
    return np.asarray(LinearNDInterpolator(place, np.tile(values, 2)[first])(wanted))


def _refuse_sparse(
    theta_i: float, node: FloatArray, away_deg: float, count: int, format_name: str
) -> NoReturn:
    theta_r = np.degrees(np.arccos(np.clip(node[2], -1, 1)))
    dphi = np.degrees(np.arctan2(abs(node[1]), node[0])) if theta_r > _SAME_DEG else 0.0
    refuse(
        format_name,
        f"needs values all round the specular direction of each incidence: at theta_i {theta_i:g} "
        f"the direction theta_r {theta_r:.1f}, dphi {dphi:.0f} is {away_deg:.0f} degrees from the "
        f"nearest of {count} measured ones; allowed: {FARTHEST_DEG:g} degrees",
        "scan both sides of the normal to 70 degrees or more at each theta_i, in the plane of "
        "incidence alone or at azimuths all round, or export as astm",
    )
