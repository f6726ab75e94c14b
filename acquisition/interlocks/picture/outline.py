"""Geometry of a surface's outline in the picture, and its comparison with the edges that are found.

The edges of a flat rectangle show the view angle (foreshortening, and the perspective between the
near and the far edge), its size, and its place. What is found is compared with what is expected by
all edges together, within a covariance to which each picture adds what it tells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from acquisition.interlocks.picture.edges import FoundEdge
from instrument.geometry import FloatArray
from instrument.pinhole import Pinhole, rectangle_mm

LIMIT_SIGMA = 6.0
"""Probability of stopping a series without a fault, 2e-9: a scan may have 1e5 series."""
# Chi2 of two values for each edge that is exceeded as rarely (scipy.stats.chi2.isf).
CHI2_LIMITS = {2: 40.09, 4: 46.46, 6: 51.88, 8: 56.80}
LENS_DISTORTION = 5e-4
"""Standard uncertainty of an edge as a share of the picture's width: a good lens distorts 0.1 %."""
_LEAST_U_PX = 0.2  # of an edge, in a small picture: half of its blur
_FREE = 100.0  # standard uncertainty in deg or mm of a parameter to be found
_CONVERGED = 1e-9  # change in deg or mm of a parameter that fits
_LEAST_EDGES = 2  # one edge alone may be that of something else


@dataclass(frozen=True, slots=True)
class Rectangle:
    """Flat rectangular surface, centred on the rotation axis, and its size in mm."""

    width_mm: float
    height_mm: float

    def __str__(self) -> str:
        return f"{self.width_mm:.4g} x {self.height_mm:.4g} mm"


@dataclass(frozen=True, slots=True)
class Deviation:
    """Departure of a real outline from the expected one, or its standard uncertainty.

    Of one picture, theta_r_deg: of the view angle; column_mm, row_mm: of the axis in the picture.
    As long as the surface lies there, x_mm, y_mm, turn_deg: in its plane; z_mm: of its height;
    lean_deg, tilt_deg: of its slope about the y axis, like theta_r, and about the x axis;
    width_mm, height_mm: of its size; field: relative, of the camera's field width; roll_deg: of the
    camera about its axis.
    """

    theta_r_deg: float = 0.0
    column_mm: float = 0.0
    row_mm: float = 0.0
    x_mm: float = 0.0
    y_mm: float = 0.0
    turn_deg: float = 0.0
    z_mm: float = 0.0
    lean_deg: float = 0.0
    tilt_deg: float = 0.0
    width_mm: float = 0.0
    height_mm: float = 0.0
    field: float = 0.0
    roll_deg: float = 0.0

    @classmethod
    def of(cls, values: FloatArray) -> Self:
        """Return the deviation with these values (13,), in the order and units of the fields."""
        return cls(*values.tolist())

    @property
    def values(self) -> FloatArray:
        """Values (13,) in the order of the fields; units as in their names."""
        return np.array([getattr(self, name) for name in _NAMES])


_NAMES = tuple(Deviation.__dataclass_fields__)
_LASTS = np.array([name not in ("theta_r_deg", "column_mm", "row_mm") for name in _NAMES])


@dataclass(frozen=True, slots=True)
class Estimate:
    """Deviation as far as it is known: mean (13,) and covariance (13, 13), units as in its names.

    u: standard uncertainties without any picture.
    """

    u: Deviation
    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def of(cls, u: Deviation) -> Self:
        """Return the estimate without any picture."""
        return cls(u, np.zeros(len(_NAMES)), np.diag(u.values**2))

    def for_next_picture(self, mean: FloatArray, covariance: FloatArray) -> Self:
        """Return what a picture's mean (13,) and covariance (13, 13), in those units, leave."""
        lasting = np.where(np.outer(_LASTS, _LASTS), covariance, np.diag(self.u.values**2))
        return replace(self, mean=np.where(_LASTS, mean, 0.0), covariance=lasting)


@dataclass(frozen=True)
class Outline:
    """Expected outline of a surface in the picture, with what is known of its deviation."""

    pinhole: Pinhole
    theta_r_deg: float
    surface: Rectangle
    known: Estimate

    def corners_px(self, deviation: Deviation = Deviation()) -> FloatArray:
        """Return the corners (4, 2) of a surface that deviates, in pixels as (column, row)."""
        d, camera = deviation, self.pinhole
        mm = camera.beam_length_mm / camera.focal_px
        pinhole = replace(
            camera,
            field_width_mm=camera.field_width_mm * (1 + d.field),
            roll_deg=camera.roll_deg + d.roll_deg,
            axis_column_px=camera.axis_column_px + d.column_mm / mm,
            axis_row_px=camera.axis_row_px + d.row_mm / mm,
        )
        size = self.surface.width_mm + d.width_mm, self.surface.height_mm + d.height_mm
        turn = np.radians(d.turn_deg)
        rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        moved = rectangle_mm(*size) @ rotation + np.array([d.x_mm, d.y_mm])
        theta_r_deg = self.theta_r_deg + d.theta_r_deg + d.lean_deg
        low, high = (pinhole.project(moved, theta_r_deg, d.z_mm + z) for z in (0.0, 1.0))
        raised_mm = moved[:, 1:] * np.tan(np.radians(d.tilt_deg))
        tilted: FloatArray = low + raised_mm * (high - low)
        return tilted

    def offsets_px(self, edges: Sequence[FoundEdge], deviation: Deviation) -> FloatArray:
        """Return the offsets (M,) in pixels, two for each edge, of a surface that deviates."""
        corners = self.corners_px(deviation)
        return np.concatenate([_crossings(corners, edge) for edge in edges])

    def gradient(self, edges: Sequence[FoundEdge], at: Deviation) -> FloatArray:
        """Return the derivatives (M, 13) of the offsets, in pixels per unit of the deviation."""
        steps = np.array([1e-4 if name == "field" else 0.01 for name in _NAMES])
        here = self.offsets_px(edges, at)
        columns = [
            (self.offsets_px(edges, Deviation.of(at.values + step)) - here) / step.sum()
            for step in np.diag(steps)
        ]
        return np.column_stack(columns)


def _crossings(corners: FloatArray, edge: FoundEdge) -> FloatArray:
    start = corners[edge.index]
    along = corners[(edge.index + 1) % 4] - start
    normal = np.array([along[1], -along[0]])
    distance: FloatArray = (start - edge.points_px) @ normal / np.dot(edge.normal, normal)
    return distance


@dataclass(frozen=True)
class Comparison:
    """Found edges compared with an expected outline."""

    outline: Outline
    edges: Sequence[FoundEdge]

    @cached_property
    def found_px(self) -> FloatArray:
        """Offsets (M,) of the found edges in pixels, outwards."""
        return np.concatenate([edge.offsets_px for edge in self.edges])

    @cached_property
    def _variance_px2(self) -> FloatArray:
        """Variance (M,) of the found offsets in pixels squared."""
        lens_px = max(LENS_DISTORTION * self.outline.pinhole.width_px, _LEAST_U_PX)
        return np.repeat([edge.u_px**2 + lens_px**2 for edge in self.edges], 2)

    @cached_property
    def _gradient(self) -> FloatArray:
        return self.outline.gradient(self.edges, Deviation.of(self.outline.known.mean))

    @cached_property
    def _residual_px(self) -> FloatArray:
        at = Deviation.of(self.outline.known.mean)
        return self.found_px - self.outline.offsets_px(self.edges, at)

    @cached_property
    def covariance_px2(self) -> FloatArray:
        """Covariance (M, M) in pixels squared of the found offsets about the expected ones."""
        known = self._gradient @ self.outline.known.covariance @ self._gradient.T
        covariance: FloatArray = known + np.diag(self._variance_px2)
        return covariance

    @cached_property
    def chi2(self) -> float:
        """Sum of squares of the offsets in standard uncertainties, 2 for each edge."""
        return float(self._residual_px @ np.linalg.solve(self.covariance_px2, self._residual_px))

    @property
    def chi2_limit(self) -> float:
        """Largest allowed chi2."""
        return CHI2_LIMITS[len(self.found_px)]

    @property
    def contradicts(self) -> bool:
        """True if the surface cannot be where the pose puts it."""
        return len(self.edges) >= _LEAST_EDGES and self.chi2 > self.chi2_limit

    @property
    def slip_limit_deg(self) -> float:
        """Least slip of theta_r that would contradict, in degrees; infinite if none would."""
        if len(self.edges) < _LEAST_EDGES:
            return float("inf")
        by_deg = self._gradient[:, _NAMES.index("theta_r_deg")]
        return float(
            np.sqrt(self.chi2_limit / (by_deg @ np.linalg.solve(self.covariance_px2, by_deg)))
        )

    def learnt(self) -> Estimate:
        """Return what is known of the deviation after this picture (Kalman 1960)."""
        known = self.outline.known
        gain = np.linalg.solve(self.covariance_px2, self._gradient @ known.covariance).T
        mean = known.mean + gain @ self._residual_px
        return known.for_next_picture(mean, known.covariance - gain @ self._gradient
                                      @ known.covariance)  # fmt: skip

    def with_free(self, *names: str) -> tuple[Deviation, Deviation, float]:
        """Return the deviation that fits with these parameters free, its u, and its chi2."""
        known, weights = self.outline.known, 1 / self._variance_px2
        u = np.array([_FREE if name in names else 1e-5 for name in _NAMES])
        prior = np.linalg.inv(known.covariance + np.diag(u**2))
        values = known.mean
        for _ in range(12):
            at = Deviation.of(values)
            gradient = self.outline.gradient(self.edges, at)
            residual = self.found_px - self.outline.offsets_px(self.edges, at)
            normal = gradient.T @ (weights[:, np.newaxis] * gradient) + prior
            away = prior @ (values - known.mean)
            step = np.linalg.solve(normal, gradient.T @ (weights * residual) - away)
            values = values + np.clip(step, -10, 10)
            if np.abs(step).max() < _CONVERGED:
                break
        at, away = Deviation.of(values), values - known.mean
        residual = self.found_px - self.outline.offsets_px(self.edges, at)
        chi2 = float(residual @ (weights * residual) + away @ prior @ away)
        return at, Deviation.of(np.sqrt(np.diag(np.linalg.inv(normal)))), chi2
