"""Map of a sample: values and u of each parameter in each cell, and what the sample is like."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.sample_maps.spread import Spread, rejected, spread_of
from instrument.devices import CHANNELS
from instrument.geometry import BoolArray, FloatArray

UNITS = {
    "albedo": "",
    **{f"albedo_{channel}": "" for channel in CHANNELS},
    "sigma_deg": "°",
    "ks": "",
    **{f"ks_{channel}": "" for channel in CHANNELS},
}
"""Units of all parameters that a map may have; those with a channel are of a colour camera."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleMap:
    """Parameters of a model in each cell: maps (rows, columns), row 0 at the largest y.

    x_mm (columns,), y_mm (rows,): middles of the cells, from the rotation axis. values, u_own: by
    parameter; u_own is independent of other cells but neighbours; u_shared, by parameter too,
    is by what all cells share. mean: value and u of the fit to the window's mean curve.
    chi2, count: of each cell, over `count` geometries. geometries: number of all. relative: without
    a white tile; albedo and ks then count relative to one another. height_mm: of the surface above
    the axis, with its u, infinite where no texture shows it. notes: one sentence each.
    """

    title: str
    sample: str
    model: str
    relative: bool
    cell_mm: float
    x_mm: FloatArray
    y_mm: FloatArray
    values: Mapping[str, FloatArray]
    u_own: Mapping[str, FloatArray]
    u_shared: Mapping[str, FloatArray]
    mean: Mapping[str, tuple[float, float | None]]
    chi2: FloatArray
    count: FloatArray
    geometries: int
    height_mm: tuple[float, float]
    notes: tuple[str, ...] = ()

    @property
    def colour(self) -> FloatArray | None:
        """Albedo (rows, columns, 3), dimensionless, in red, green and blue; None without colour."""
        names = [f"albedo_{channel}" for channel in CHANNELS]
        if not set(names) <= set(self.values):
            return None
        return np.stack([self.values[name] for name in names], axis=-1)

    @property
    def fitted(self) -> BoolArray:
        """True for each cell (rows, columns) that has a fit."""
        return np.isfinite(self.chi2)

    @property
    def rejected(self) -> BoolArray:
        """True for each cell (rows, columns) of which the model does not hold."""
        dof = np.nan_to_num(self.count).astype(np.int64) - len(self.values)
        return rejected(self.chi2, dof)

    @property
    def rejected_share(self) -> float:
        """Share of the fitted cells of which the model does not hold, 0 to 1."""
        return float(self.rejected.sum() / max(int(self.fitted.sum()), 1))

    def u(self, name: str) -> FloatArray:
        """Return the standard uncertainty (rows, columns) of a parameter, in its unit."""
        return np.hypot(self.u_own[name], self.u_shared[name])

    def spread(self, name: str) -> Spread | None:
        """Return the spread of a parameter over the cells, in its unit; None without cells."""
        return spread_of(self.values[name], self.u_own[name])

    @property
    def uniform(self) -> bool:
        """True if no parameter scatters beyond its u."""
        return all(s.uniform for s in map(self.spread, self.values) if s is not None)

    def headline(self) -> str:
        """Return in one sentence: the sample is uniform, or in what it is not."""
        varies = [n for n in self.values if (s := self.spread(n)) is not None and not s.uniform]
        if not varies:
            return "The sample is uniform: its cells scatter no more than their u."
        listed = " and ".join(filter(None, (", ".join(varies[:-1]), varies[-1])))
        return f"The sample is not uniform: its cells differ in {listed}."
