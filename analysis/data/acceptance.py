"""Acceptance of a rig: BRDF and radiance averaged over lamp disc, camera lens and measured patch.

A BRDF is defined for two single directions; a rig measures its mean over two cones and an area.
The mean includes the inverse-square law, the local angles at each point of the sample, and no light
from below the horizon.

Axes as in `instrument/geometry.py`, in mm, with the origin where the rotation axis meets the
sample. Lamp and lens are flat discs that face the origin, with the radius of the cone of their
solid angle. The lamp radiates uniformly over its area and in all directions, so that the irradiance
by each part of it is proportional to cos(local theta_i) / distance squared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from instrument.geometry import (
    Brdf,
    FloatArray,
    Geometry,
    IntArray,
    camera_direction,
    cone_half_angle_deg,
    lamp_direction,
)

if TYPE_CHECKING:
    from instrument.config.protocol import PatchConfig
    from instrument.config.rig import Rig


MAX_RINGS = 6

# Evaluations in one block: few enough that the arrays stay in the processor's cache.
_BLOCK = 32_768
_X_AXIS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceptance:
    """Sizes of lamp, lens and patch: distances in mm, solid angles in sr as seen from the origin.

    The patch is a rectangle about the origin: its width along x, in which the camera swings, its
    height along y. Raises `ValueError` for a distance that is not positive, a solid angle outside
    0 to 1 sr, or a patch side that is negative.
    """

    beam_length_mm: float
    lamp_distance_mm: float
    source_solid_angle_sr: float
    receiver_solid_angle_sr: float
    patch_width_mm: float
    patch_height_mm: float

    def __post_init__(self) -> None:
        for name in ("beam_length_mm", "lamp_distance_mm"):
            _require(name, getattr(self, name) > 0, getattr(self, name), "more than 0 mm")
        for name in ("source_solid_angle_sr", "receiver_solid_angle_sr"):
            _require(name, 0 <= getattr(self, name) <= 1, getattr(self, name), "0 to 1 sr")
        for name in ("patch_width_mm", "patch_height_mm"):
            _require(name, getattr(self, name) >= 0, getattr(self, name), "0 mm or more")

    @classmethod
    def of(cls, rig: Rig, window: PatchConfig) -> Acceptance:
        """Acceptance of a rig, for the window that a protocol measures."""
        return cls(
            beam_length_mm=rig.beam_length_mm,
            lamp_distance_mm=rig.lamp_distance_mm,
            source_solid_angle_sr=rig.source_solid_angle_sr,
            receiver_solid_angle_sr=rig.receiver_solid_angle_sr,
            patch_width_mm=window.width_mm,
            patch_height_mm=window.height_mm,
        )

    def patch(self, nodes: int) -> tuple[FloatArray, FloatArray]:
        """Gauss-Legendre points on the patch (P, 3) in mm, weights (P,) of sum 1, P = nodes^2."""
        t, w = np.polynomial.legendre.leggauss(nodes)
        x, y = np.meshgrid(t * self.patch_width_mm / 2, t * self.patch_height_mm / 2)
        points = np.stack([x.ravel(), y.ravel(), np.zeros(nodes * nodes)], axis=-1)
        return points, np.outer(w, w).ravel() / 4


def _require(name: str, valid: bool, value: float, allowed: str) -> None:
    if not (valid and np.isfinite(value)):
        raise ValueError(f"{name} = {value:g}; allowed: {allowed}, finite")


@lru_cache(maxsize=64)
def disc_rule(rings: int, turn: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Quadrature over the unit disc: nodes (M, 2) and weights (M,) that sum to 1, M = 4 rings^2.

    Gauss-Legendre in the square of the radius, 4 rings equally spaced angles: the mean of every
    polynomial in x, y up to degree 4 rings - 1 is exact. `turn` rotates the nodes by that fraction
    of the angle between two of them. rings = 0 is the centre alone (exact to degree 1). The arrays,
    in units of the disc's radius, are cached and read-only. Raises `ValueError` for negative
    `rings`.
    """
    if rings < 0:
        raise ValueError(f"rings = {rings}; allowed: 0 or more")
    if rings == 0:
        return _read_only(np.zeros((1, 2))), _read_only(np.ones(1))
    t, w = np.polynomial.legendre.leggauss(rings)
    radius = np.sqrt((t + 1) / 2)[:, np.newaxis]
    angle = 2 * np.pi * (np.arange(4 * rings) + turn) / (4 * rings)
    nodes = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    return _read_only(nodes), _read_only(np.repeat(w / 2, 4 * rings) / (4 * rings))


def _read_only(array: FloatArray) -> FloatArray:
    array.setflags(write=False)
    return array


def radiance(
    brdf: Brdf,
    points_mm: FloatArray,
    theta_i_deg: ArrayLike,
    theta_r_deg: ArrayLike,
    dphi_deg: ArrayLike,
    acceptance: Acceptance,
    rings: int,
) -> FloatArray:
    """Radiance of points of the sample, averaged over the lens, for a lamp of irradiance 1.

    The irradiance is 1 at the origin at normal incidence. Parts of the lens are weighted by
    cos(local theta_r) / distance squared, with weights of sum 1. Parts of lens or lamp below a
    point's horizon have no weight; a point from which no part of the lens or of the lamp is visible
    has radiance 0.

    `points_mm` has the shape (..., 3); the angles in degrees broadcast, with `theta_r_deg` signed;
    `brdf` is in 1/sr. The result has the angles' shape followed by that of the points: (N,) and
    (P, 3) give (N, P).
    """
    return _radiance(brdf, points_mm, (theta_i_deg, theta_r_deg, dphi_deg), acceptance, rings)[0]


def averaged_brdf(
    brdf: Brdf,
    theta_i_deg: ArrayLike,
    theta_r_deg: ArrayLike,
    dphi_deg: ArrayLike,
    acceptance: Acceptance,
    rings: int,
    patch_nodes: int = 3,
) -> FloatArray:
    """BRDF in 1/sr as the rig measures it, of the angles' shape (degrees, `theta_r_deg` signed).

    Mean radiance over lens and patch, divided by the patch's mean irradiance, as measured with an
    ideal white tile in the sample's place: a Lambertian BRDF is not changed. The patch is averaged
    over `patch_nodes` x `patch_nodes` Gauss-Legendre points. Raises `ValueError` where no light
    falls on the patch.
    """
    points, weights = acceptance.patch(patch_nodes)
    angles = (theta_i_deg, theta_r_deg, dphi_deg)
    sample, tile = _radiance(brdf, points, angles, acceptance, rings)
    light = tile @ weights
    if np.any(light <= 0):
        dark = np.broadcast_to(np.asarray(theta_i_deg, dtype=np.float64), light.shape)[light <= 0]
        raise ValueError(
            f"no light visible to the camera falls on the patch at theta_i = "
            f"{dark.flat[0]:g} degrees; allowed: angles with lamp and lens above the horizon"
        )
    return np.asarray(sample @ weights / light)


def required_rings(
    brdf: Brdf,
    theta_i_deg: ArrayLike,
    theta_r_deg: ArrayLike,
    dphi_deg: ArrayLike,
    acceptance: Acceptance,
    *,
    tolerance: ArrayLike = 1e-4,
    most: int = MAX_RINGS,
) -> IntArray:
    """Number of rings that each geometry needs, of the angles' shape (degrees).

    The smallest number at which one more ring changes the averaged BRDF by no more than
    `tolerance`, relative, which broadcasts against the angles. Tested at the patch's centre, since
    the patch is small compared with lamp and lens. Returns `most` where that is still not enough,
    as at a sharp kink of a model.
    """
    arrays = _broadcast(theta_i_deg, theta_r_deg, dphi_deg, tolerance)
    rows = np.stack([a.ravel() for a in arrays])
    rings = np.full(rows.shape[1], most)
    todo = np.arange(rings.size)
    now = averaged_brdf(brdf, rows[0], rows[1], rows[2], acceptance, 0, 1)
    for n in range(most):
        theta_i, theta_r, dphi, limit = rows[:, todo]
        finer = averaged_brdf(brdf, theta_i, theta_r, dphi, acceptance, n + 1, 1)
        enough = np.abs(finer - now) <= limit * np.abs(finer)
        rings[todo[enough]] = n
        todo, now = todo[~enough], finer[~enough]
        if todo.size == 0:
            break
    return rings.reshape(arrays[0].shape)


def _broadcast(*values: ArrayLike) -> tuple[FloatArray, ...]:
    return np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in values))


def _radiance(
    brdf: Brdf,
    points_mm: FloatArray,
    angles: tuple[ArrayLike, ArrayLike, ArrayLike],
    acceptance: Acceptance,
    rings: int,
) -> tuple[FloatArray, FloatArray]:
    """Radiance of the sample, and of a BRDF of 1 in its place; angles' shape + points' shape."""
    theta_i, theta_r, dphi = _broadcast(*angles)
    points = np.asarray(points_mm, dtype=np.float64)
    shape = theta_i.shape + points.shape[:-1]
    geometry, point = np.divmod(np.arange(int(np.prod(shape))), max(1, points[..., 0].size))
    places = points.reshape(-1, 3)
    flat = [a.ravel() for a in (theta_i, theta_r, dphi)]
    sample, tile = np.empty(geometry.size), np.empty(geometry.size)
    block = max(1, _BLOCK // max(1, 16 * rings**4))
    for start in range(0, geometry.size, block):
        part = slice(start, start + block)
        chosen = [a[geometry[part]] for a in flat]
        sample[part], tile[part] = _block(brdf, places[point[part]], chosen, acceptance, rings)
    return sample.reshape(shape), tile.reshape(shape)


def _block(
    brdf: Brdf, points: FloatArray, angles: list[FloatArray], acceptance: Acceptance, rings: int
) -> tuple[FloatArray, FloatArray]:
    """As `_radiance` for pairs of one point, (Q, 3), and one geometry, (Q,) each."""
    theta_i_deg, theta_r_deg, dphi_deg = angles
    # The nodes of lens and lamp are rotated against each other and against the scan's plane, so
    # that they sample a kink of the BRDF at many different angles.
    lens = _disc_nodes(
        camera_direction(theta_r_deg),
        camera_direction(theta_r_deg + 90.0),
        acceptance.beam_length_mm,
        acceptance.receiver_solid_angle_sr,
        disc_rule(rings, 0.25),
    )
    lamp = _disc_nodes(
        lamp_direction(theta_i_deg, dphi_deg),
        lamp_direction(theta_i_deg + 90.0, dphi_deg),
        acceptance.lamp_distance_mm,
        acceptance.source_solid_angle_sr,
        disc_rule(rings, 0.5),
    )
    theta_r, phi_r, seen = _directions_from(points, lens, disc_rule(rings)[1])
    theta_i, phi_i, lit = _directions_from(points, lamp, disc_rule(rings)[1])
    total = seen.sum(axis=-1, keepdims=True)
    seen = np.divide(seen, total, out=np.zeros_like(seen), where=total > 0)
    lit = lit / _normal_irradiance(acceptance, rings)
    values = brdf(_node_pairs(theta_i, theta_r, phi_i, phi_r))
    sample = np.einsum("qk,qk->q", lit, np.matmul(values, seen[:, :, np.newaxis])[:, :, 0])
    return sample, lit.sum(axis=-1) * seen.sum(axis=-1)


def _disc_nodes(
    direction: FloatArray,
    tangent: FloatArray,
    distance: float,
    solid_angle: float,
    rule: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Nodes (Q, M, 3) in mm on discs that face the origin along unit vectors (Q, 3)."""
    radius = distance * np.tan(np.radians(cone_half_angle_deg(solid_angle)))
    across = np.stack([tangent, np.cross(direction, tangent)], axis=-2)
    return np.asarray(distance * direction[:, np.newaxis, :] + radius * (rule[0] @ across))


def _directions_from(
    points: FloatArray, nodes: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Polar angle and azimuth in degrees, and weight cos / r^2, of nodes (Q, M) from (Q, 3).

    A node at or below the horizon has weight 0 and the direction of the zenith, at which any BRDF
    is defined.
    """
    to = nodes - points[:, np.newaxis, :]
    r2 = np.einsum("qmi,qmi->qm", to, to)
    direction = to / np.sqrt(r2)[:, :, np.newaxis]
    below = direction[..., 2] <= 0
    direction[below] = (0.0, 0.0, 1.0)
    seen = Geometry.from_directions(_X_AXIS, direction)
    weight = np.where(below, 0.0, weights * direction[..., 2] / r2)
    return seen.theta_r_deg, seen.dphi_deg, weight


@lru_cache(maxsize=64)
def _normal_irradiance(acceptance: Acceptance, rings: int) -> float:
    """Irradiance at the origin by the lamp at the zenith, in the units of `_directions_from`."""
    zenith = np.array([[0.0, 0.0, 1.0]])
    lamp = _disc_nodes(
        zenith,
        np.array([[1.0, 0.0, 0.0]]),
        acceptance.lamp_distance_mm,
        acceptance.source_solid_angle_sr,
        disc_rule(rings),
    )
    return float(_directions_from(np.zeros((1, 3)), lamp, disc_rule(rings)[1])[2].sum())


def _node_pairs(
    theta_i: FloatArray, theta_r: FloatArray, phi_i: FloatArray, phi_r: FloatArray
) -> Geometry:
    """Geometry (Q, K, M) of every lamp node (Q, K) with every lens node (Q, M)."""
    dphi = phi_r[:, np.newaxis, :] - phi_i[:, :, np.newaxis]
    dphi += 360.0 * (dphi < 0)
    return Geometry(
        np.broadcast_to(theta_i[:, :, np.newaxis], dphi.shape),
        np.broadcast_to(theta_r[:, np.newaxis, :], dphi.shape),
        dphi,
    )
