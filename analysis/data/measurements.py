"""Measurements: angles, BRDF, and the sources of its uncertainty.

Points share errors to different degrees: noise is independent, a lamp's angle is set once for many
points, a white tile is measured once for many, and its certificate applies to all. Fits need to
know which points share an error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from instrument.geometry import BoolArray, FloatArray, Geometry, IntArray

_ARRAYS = ("theta_i_deg", "theta_r_deg", "dphi_deg", "brdf", "u_random", "lamp_setting")


@dataclass(frozen=True, slots=True)
class SharedError:
    """Error that points share: all points with the same number in `group` (N,) have the same one.

    u_relative: (N,), signed change of each point by one standard deviation of the error, relative
    to its value; 0 for points that do not have it.
    theta_i_deg, theta_r_deg, dphi_deg: (N,) or 0, signed change of the true angles by one standard
    deviation of the error. What it does to the value depends on the reflectance and is not in
    `u_relative`.
    """

    name: str
    u_relative: FloatArray
    group: IntArray
    theta_i_deg: FloatArray | float = 0.0
    theta_r_deg: FloatArray | float = 0.0
    dphi_deg: FloatArray | float = 0.0

    def subset(self, points: BoolArray) -> SharedError:
        """The same error for the points marked True in `points` (N,)."""
        angles = (np.broadcast_to(a, points.shape)[points] for a in self.angles_deg)
        return SharedError(self.name, self.u_relative[points], self.group[points], *angles)

    @property
    def angles_deg(self) -> tuple[FloatArray | float, FloatArray | float, FloatArray | float]:
        """Change of theta_i, theta_r, dphi by one standard deviation, (N,) or 0, in degrees."""
        return self.theta_i_deg, self.theta_r_deg, self.dphi_deg

    @classmethod
    def common_to_all(cls, name: str, u_relative: float, size: int) -> SharedError:
        """Error that all of `size` points share, with the same relative u."""
        return cls(name, np.full(size, u_relative), np.zeros(size, dtype=np.int64))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurements:
    """Measured BRDF and the parts of its standard uncertainty; arrays have the shape (N,).

    theta_i_deg, theta_r_deg, dphi_deg: angles in degrees; theta_r signed as in the protocol.
    brdf: in 1/sr.
    u_random: in 1/sr, noise, quantisation and drift, independent from point to point; None: not
        stated, then the fit estimates it, and those of the angles must be 0.
    lamp_setting: points with the same number share one setting of theta_i and dphi, and its errors.
    shared: further shared errors, such as those of a white tile or of the dark frames.
    u_theta_i_deg, u_theta_r_deg, u_dphi_deg: of the angles, in degrees; points with the same
        theta_r share its error.
    blur_deg: (N,) or 0, angle by which theta_r turned while a value was taken, which is the mean
        over it; theta_r_deg is its middle.
    relative: `brdf` and `u_random` are radiance in a unit of its own, without a reference.
    free_levels: the lamp's brightness at each of its settings is unknown.
    geometry: (N,), that of the points; one object, so that models compute once what depends on it.

    Raises `ValueError` for shapes that differ, values that are not finite, angles outside their
    domain, a `u_random` that is not positive, or a negative uncertainty of an angle or blur.
    """

    theta_i_deg: FloatArray
    theta_r_deg: FloatArray
    dphi_deg: FloatArray
    brdf: FloatArray
    u_random: FloatArray | None
    lamp_setting: IntArray
    shared: tuple[SharedError, ...] = ()
    u_theta_i_deg: float = 0.0
    u_theta_r_deg: float = 0.0
    u_dphi_deg: float = 0.0
    blur_deg: FloatArray | float = 0.0
    relative: bool = False
    free_levels: bool = False
    geometry: Geometry = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        self._check_arrays()
        for name in ("u_theta_i_deg", "u_theta_r_deg", "u_dphi_deg"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} = {value:g}; allowed: finite, 0 or more")
            if value > 0 and self.u_random is None:
                raise ValueError(f"{name} = {value:g} is stated, so u_random must be stated too")
        geometry = Geometry.from_degrees(  # checks that the angles are within their domain
            theta_i=self.theta_i_deg, theta_r=self.theta_r_deg, dphi=self.dphi_deg
        )
        object.__setattr__(self, "geometry", geometry)

    def _check_arrays(self) -> None:
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        for error in self.shared:
            arrays |= {error.name: error.u_relative, f"group of {error.name}": error.group}
        if np.ndim(self.blur_deg):
            arrays["blur_deg"] = self.blur_deg
        shape = (np.size(self.brdf),)
        for name, array in arrays.items():
            if array is None:
                continue
            if np.shape(array) != shape:
                raise ValueError(f"{name} has the shape {np.shape(array)}; allowed: {shape}")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"{name} holds a value that is not finite")
        if not np.all(np.asarray(self.blur_deg) >= 0):
            raise ValueError(f"blur_deg = {np.min(self.blur_deg):g} deg; allowed: 0 deg or more")
        furthest_deg = np.max(np.abs(self.theta_r_deg) + np.asarray(self.blur_deg) / 2, initial=0.0)
        if np.any(self.blur_deg) and furthest_deg > 90:
            raise ValueError(f"theta_r turned to {furthest_deg:g} deg; allowed: up to 90 deg")
        if self.u_random is not None and np.any(self.u_random <= 0):
            raise ValueError(f"u_random = {self.u_random.min():g} 1/sr; allowed: more than 0 1/sr")

    @classmethod
    def bare(
        cls,
        theta_i_deg: ArrayLike,
        theta_r_deg: ArrayLike,
        dphi_deg: ArrayLike,
        brdf: ArrayLike,
        u_brdf: ArrayLike | None = None,
    ) -> Measurements:
        """Measurements without shared errors: angles in degrees, BRDF and perhaps its u in 1/sr.

        Arguments broadcast to the shape (N,). Points with the same theta_i and dphi count as one
        setting of the lamp.
        """
        parts = [theta_i_deg, theta_r_deg, dphi_deg, brdf, 0.0 if u_brdf is None else u_brdf]
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in parts))
        theta_i, theta_r, dphi, value, u = (a.reshape(-1).copy() for a in arrays)
        return cls(
            theta_i_deg=theta_i,
            theta_r_deg=theta_r,
            dphi_deg=dphi,
            brdf=value,
            u_random=None if u_brdf is None else u,
            lamp_setting=setting_numbers(theta_i, dphi),
        )

    def subset(self, points: BoolArray) -> Measurements:
        """The points marked True in `points` (N,), with their shared errors."""
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        chosen = {name: array[points] for name, array in arrays.items() if array is not None}
        if isinstance(self.blur_deg, np.ndarray):
            chosen["blur_deg"] = self.blur_deg[points]
        return replace(self, **chosen, shared=tuple(error.subset(points) for error in self.shared))

    @property
    def size(self) -> int:
        """Number of points."""
        return int(self.brdf.size)


def setting_numbers(theta_i_deg: FloatArray, dphi_deg: FloatArray) -> IntArray:
    """Number of each point's lamp setting (N,): equal for equal theta_i and dphi (N,), degrees."""
    lamps, azimuths = (
        np.unique(angle, return_inverse=True)[1].astype(np.int64)
        for angle in (theta_i_deg, dphi_deg)
    )
    pairs = lamps * (azimuths.max(initial=0) + 1) + azimuths
    return np.unique(pairs, return_inverse=True)[1].reshape(-1).astype(np.int64)
