"""Angles at each place of a sample: lamp and camera are near, so that they differ over it.

10 mm off the axis, a camera at 800 mm stands by up to 0.7 degrees elsewhere. The parts of the BRDF
change by a smooth function of the place: they are computed at nine places, and interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.sample_maps.sigma_table import SigmaTable
from instrument.geometry import FloatArray, Geometry

_NODES = 3  # places along x and along y, where the parts are computed


@dataclass(frozen=True, slots=True)
class Places:
    """Positions in mm of the lamp and of the camera, (K, 3) each, for K geometries."""

    lamp_mm: FloatArray
    camera_mm: FloatArray

    def geometry(self, x_mm: float, y_mm: float) -> Geometry:
        """Return the angles (K,) in degrees at a place of the sample, in mm from the axis."""
        to_lamp, to_camera = (
            position - np.array([x_mm, y_mm, 0.0]) for position in (self.lamp_mm, self.camera_mm)
        )
        return Geometry.from_directions(_unit(to_lamp), _unit(to_camera))

    def irradiance(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Return the light on each place (K, rows, columns), relative to that on the axis.

        x_mm (columns,) and y_mm (rows,). Of a lamp that is a point: cos(theta_i) / distance^2.
        """
        lamp = self.lamp_mm[:, :, np.newaxis, np.newaxis]
        apart = (lamp[:, 0] - x_mm) ** 2 + (lamp[:, 1] - y_mm[:, np.newaxis]) ** 2 + lamp[:, 2] ** 2
        on_axis = np.sum(lamp**2, axis=1)
        return np.asarray((on_axis / apart) ** 1.5)


@dataclass(frozen=True, slots=True)
class TableField:
    """Tables of a model's parts over a rectangle of the sample, by the place in mm.

    x_mm, y_mm: (3,), the places of the tables. sigma_deg: (S,). once, twice, lobe: (9, S, K) in
    1/sr, one table for each y and x, in this order; lobe None without one.
    """

    x_mm: FloatArray
    y_mm: FloatArray
    sigma_deg: FloatArray
    once: FloatArray
    twice: FloatArray
    lobe: FloatArray | None

    @classmethod
    def of(cls, model: str, places: Places, half_mm: tuple[float, float]) -> TableField:
        """Return the tables over a rectangle about the axis with these half sides in mm."""
        x, y = (half * np.linspace(-1, 1, _NODES) for half in half_mm)
        tables = [SigmaTable.of(model, places.geometry(a, b)) for b in y for a in x]
        lobes = [t.lobe for t in tables if t.lobe is not None]
        return cls(
            x,
            y,
            tables[0].sigma_deg,
            np.stack([t.once for t in tables]),
            np.stack([t.twice for t in tables]),
            np.stack(lobes) if lobes else None,
        )

    def at(self, x_mm: float, y_mm: float) -> SigmaTable:
        """Return the table at a place."""
        weights = np.outer(_lagrange(y_mm, self.y_mm), _lagrange(x_mm, self.x_mm)).ravel()
        once, twice = (np.tensordot(weights, a, 1) for a in (self.once, self.twice))
        lobe = None if self.lobe is None else np.tensordot(weights, self.lobe, 1)
        return SigmaTable(self.sigma_deg, once, twice, lobe)


def _lagrange(at: float, nodes: FloatArray) -> FloatArray:
    """Return the weights (3,) of values at the nodes in the polynomial's value at a place."""
    weights = np.ones(nodes.size)
    for k, own in enumerate(nodes):
        for other in np.delete(nodes, k):
            weights[k] *= (at - other) / (own - other)
    return weights


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
