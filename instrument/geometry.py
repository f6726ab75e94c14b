r"""Angles of a reflection measurement: the convention of the whole program.

::

            z (sample normal)
        lamp \   |   / camera          theta_i, theta_r: from z, 0-90 degrees
              \  |  /                  dphi = phi_r - phi_i
        theta_i\ | /theta_r            dphi = 0:   camera on the lamp's own side
      __________\|/__________          dphi = 180: camera on the mirror side
               sample

Directions point from the sample TO the lamp (theta_i, phi_i) and TO the camera (theta_r, phi_r),
as in Oren and Nayar 1995. Nayar, Ikeuchi and Kanade 1991 count azimuth from the mirror side:
cos(phi_1991) = -cos(dphi).

A scan swings the camera in one plane with a signed theta_r: positive on the side named by dphi
(the lamp's side for dphi = 0), negative on the other, where (theta_r < 0, dphi) means the same
direction as (-theta_r, dphi + 180).

Axes of the sample: the camera swings in the x-z plane, towards +x for positive theta_r; the lamp
stands at azimuth -dphi, so that phi_r - phi_i = dphi.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_RADIANS = np.pi / 180  # the product is np.radians to the last bit, in a fifth of the time


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Geometry:
    """Angles of one or many reflections, in degrees: arrays of one shape (...), theta_r >= 0.

    `theta_i_deg` and `theta_r_deg` from 0 to 90, `dphi_deg` from 0 to 360. Equality is identity, so
    that a geometry can be the key of a cache.
    """

    theta_i_deg: FloatArray
    theta_r_deg: FloatArray
    dphi_deg: FloatArray

    @classmethod
    def from_degrees(
        cls, *, theta_i: ArrayLike, theta_r: ArrayLike, dphi: ArrayLike = 0.0
    ) -> Geometry:
        """Return the geometry of broadcastable angles in degrees; theta_r < 0 means dphi + 180.

        Raises `ValueError` for theta_i outside 0-90, theta_r outside -90-90, or a value that is
        not finite.
        """
        theta_i, theta_r, dphi = np.broadcast_arrays(
            *(np.asarray(a, dtype=np.float64) for a in (theta_i, theta_r, dphi))
        )
        _require("theta_i", theta_i, 0.0, 90.0)
        _require("theta_r", theta_r, -90.0, 90.0)
        _require("dphi", dphi, -np.inf, np.inf)
        azimuth = np.mod(np.where(theta_r < 0, dphi + 180.0, dphi), 360.0)
        return cls(theta_i.copy(), np.abs(theta_r), azimuth)

    @classmethod
    def from_directions(cls, to_lamp: FloatArray, to_camera: FloatArray) -> Geometry:
        """Return the geometry of broadcastable unit vectors (..., 3), z along the sample normal."""
        to_lamp, to_camera = np.broadcast_arrays(to_lamp, to_camera)
        s_xy = np.hypot(to_lamp[..., 0], to_lamp[..., 1])
        v_xy = np.hypot(to_camera[..., 0], to_camera[..., 1])
        dphi = np.arctan2(to_camera[..., 1], to_camera[..., 0]) - np.arctan2(
            to_lamp[..., 1], to_lamp[..., 0]
        )
        return cls(
            np.degrees(np.arctan2(s_xy, to_lamp[..., 2])),
            np.degrees(np.arctan2(v_xy, to_camera[..., 2])),
            np.mod(np.degrees(dphi), 360.0),
        )

    def blocks(self, size: int) -> Iterator[tuple[slice, Geometry]]:
        """Yield slices of the flattened angles, `size` long, and geometries (size,) in degrees."""
        flat = [a.reshape(-1) for a in (self.theta_i_deg, self.theta_r_deg, self.dphi_deg)]
        for start in range(0, flat[0].size, size):
            part = slice(start, start + size)
            yield part, Geometry(*(a[part] for a in flat))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the arrays of angles."""
        return self.theta_i_deg.shape

    @property
    def theta_i(self) -> FloatArray:
        """Angle of incidence (...) in radians, for numerical kernels: scalar or array."""
        return self.theta_i_deg * _RADIANS

    @property
    def theta_r(self) -> FloatArray:
        """View angle (...) in radians, for numerical kernels: scalar or array."""
        return self.theta_r_deg * _RADIANS

    @property
    def cos_dphi(self) -> FloatArray:
        """Cosine of dphi, a ratio, scalar or array: 1 on the lamp's side, -1 on the mirror side."""
        return np.cos(self.dphi_deg * _RADIANS)


def _require(name: str, value: FloatArray, low: float, high: float) -> None:
    wrong = ~((value >= low) & (value <= high) & np.isfinite(value))
    if np.any(wrong):
        first = value[wrong].flat[0]
        allowed = f"{low:g} to {high:g} degrees" if np.isfinite(low) else "finite degrees"
        raise ValueError(f"{name} = {first:.12g} degrees; allowed: {allowed}")


def camera_direction(theta_r_deg: ArrayLike) -> FloatArray:
    """Return the unit vector (..., 3) to the camera, for signed view angles (...) in degrees."""
    theta_r = np.radians(np.asarray(theta_r_deg, dtype=np.float64))
    return np.stack([np.sin(theta_r), np.zeros_like(theta_r), np.cos(theta_r)], axis=-1)


def lamp_direction(theta_i_deg: ArrayLike, dphi_deg: ArrayLike) -> FloatArray:
    """Return the unit vector (..., 3) to the lamp, for broadcastable angles in degrees."""
    theta_i, dphi = np.broadcast_arrays(
        np.radians(np.asarray(theta_i_deg, dtype=np.float64)),
        np.radians(np.asarray(dphi_deg, dtype=np.float64)),
    )
    return np.stack(
        [
            np.sin(theta_i) * np.cos(dphi),
            -np.sin(theta_i) * np.sin(dphi),
            np.cos(theta_i),
        ],
        axis=-1,
    )


def camera_to_lamp_deg(
    theta_i_deg: ArrayLike, theta_r_deg: ArrayLike, dphi_deg: ArrayLike
) -> FloatArray:
    """Return the angle between camera and lamp in degrees; angles broadcast, theta_r signed."""
    cosine = np.sum(lamp_direction(theta_i_deg, dphi_deg) * camera_direction(theta_r_deg), axis=-1)
    angle: FloatArray = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return angle


def cone_half_angle_deg(solid_angle_sr: float) -> float:
    """Return the half-angle in degrees of a circular cone: Omega = 2 pi (1 - cos a)."""
    return float(np.degrees(np.arccos(1.0 - solid_angle_sr / (2.0 * np.pi))))


Brdf = Callable[[Geometry], FloatArray]
"""Function that returns a BRDF in 1/sr, in the shape of the geometry's angles."""
