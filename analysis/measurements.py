"""What was measured: angles, BRDF, and where each part of its uncertainty comes from.

Errors differ in what they share: noise strikes every point by itself, a lamp's angle is set once
for many points, a white tile is measured once for many, and its certificate holds for all. Fits
need to know which is which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from instrument.geometry import FloatArray, Geometry

IntArray = NDArray[np.int64]

_ARRAYS = (
    *("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf", "u_random"),
    *("lamp_setting", "reference", "u_reference", "placement", "u_placement"),
)


@dataclass(frozen=True, slots=True)
class Measurements:
    """Measured BRDF and the parts of its standard uncertainty; arrays have the shape (N,).

    theta_i_deg, theta_r_deg, dphi_deg: angles in degrees; theta_r signed as in the protocol.
    brdf: in 1/sr.
    u_random: in 1/sr, noise, quantisation and drift, independent from point to point; None: not
        stated, then every other uncertainty must be 0.
    lamp_setting: points of one number share one setting of theta_i and dphi, and its errors.
    reference: which measurement of the white tile a point was divided by.
    u_reference: relative, noise of that measurement of the tile: common to its points.
    u_tile: relative, the tile's calibration: common to all points.
    placement: points of one number were taken with the sample placed once on its axis.
    u_placement: relative, and signed as the change that one standard deviation of the placement
        makes: common to the points of a placement. Both None: no such error.
    u_theta_i_deg, u_theta_r_deg, u_dphi_deg: of the angles, in degrees; that of theta_r is
        independent from point to point.

    Raises `ValueError` for shapes that differ, values that are not finite, angles outside their
    domain, a `u_random` that is not positive, or any other negative uncertainty.
    """

    theta_i_deg: FloatArray
    theta_r_deg: FloatArray
    dphi_deg: FloatArray
    brdf: FloatArray
    u_random: FloatArray | None
    lamp_setting: IntArray
    reference: IntArray
    u_reference: FloatArray
    u_tile: float = 0.0
    u_theta_i_deg: float = 0.0
    u_theta_r_deg: float = 0.0
    u_dphi_deg: float = 0.0
    placement: IntArray | None = None
    u_placement: FloatArray | None = None

    def __post_init__(self) -> None:
        self._check_arrays()
        for name in ("u_tile", "u_theta_i_deg", "u_theta_r_deg", "u_dphi_deg"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value:g}; allowed: finite, 0 or more")
            if value > 0 and self.u_random is None:
                raise ValueError(f"{name} = {value:g} is stated, so u_random must be stated too")
        if (self.placement is None) != (self.u_placement is None):
            raise ValueError("placement and u_placement are given both or not at all")
        _ = self.geometry  # its own checks: angles within their domain

    def _check_arrays(self) -> None:
        shape = (np.size(self.brdf),)
        for name in _ARRAYS:
            array = getattr(self, name)
            if array is None:
                continue
            if np.shape(array) != shape:
                raise ValueError(f"{name} has the shape {np.shape(array)}; allowed: {shape}")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"{name} holds a value that is not finite")
        if self.u_random is not None and np.any(self.u_random <= 0):
            raise ValueError(f"u_random = {self.u_random.min():g} 1/sr; allowed: more than 0 1/sr")
        if np.any(self.u_reference < 0):
            raise ValueError(f"u_reference = {self.u_reference.min():g}; allowed: 0 or more")
        for name, u in (("u_reference", self.u_reference), ("u_placement", self.u_placement)):
            if self.u_random is None and u is not None and np.any(u != 0):
                raise ValueError(f"{name} is stated, so u_random must be stated too")

    @classmethod
    def bare(
        cls,
        theta_i_deg: ArrayLike,
        theta_r_deg: ArrayLike,
        dphi_deg: ArrayLike,
        brdf: ArrayLike,
        u_brdf: ArrayLike | None = None,
    ) -> Measurements:
        """Measurements of which only the angles, the BRDF and perhaps its u (1/sr) are known.

        Arguments broadcast to the shape (N,). Points with the same theta_i and dphi count as one
        setting of the lamp, all points as divided by one reference; all shared errors are 0.
        """
        parts = [theta_i_deg, theta_r_deg, dphi_deg, brdf, 0.0 if u_brdf is None else u_brdf]
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in parts))
        theta_i, theta_r, dphi, value, u = (a.reshape(-1).copy() for a in arrays)
        return cls(
            theta_i,
            theta_r,
            dphi,
            value,
            None if u_brdf is None else u,
            lamp_setting=same_setting(theta_i, dphi),
            reference=np.zeros(value.size, dtype=np.int64),
            u_reference=np.zeros(value.size),
        )

    @property
    def geometry(self) -> Geometry:
        """The points' geometry."""
        return Geometry.from_degrees(
            theta_i=self.theta_i_deg, theta_r=self.theta_r_deg, dphi=self.dphi_deg
        )

    @property
    def size(self) -> int:
        """How many points there are."""
        return int(self.brdf.size)


def same_setting(theta_i_deg: FloatArray, dphi_deg: FloatArray) -> IntArray:
    """A number for each point, (N,): the same for the same theta_i and dphi."""
    pairs = np.stack([theta_i_deg, dphi_deg], axis=-1)
    return np.unique(pairs, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
