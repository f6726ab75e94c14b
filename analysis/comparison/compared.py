"""Outcome of a comparison, for the terminal and the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.comparison.agreement import Agreement
from analysis.data.measurements import Measurements
from analysis.report.style import format_value
from instrument.geometry import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """K runs at the G geometries that all have.

    names: of the runs. samples: theirs, empty where it is not known. points: number of points that
    each run has. at: the points of the first run at the G geometries. brdf: (K, G) in 1/sr.
    same_tile: one white tile gave all runs their scale.
    """

    names: tuple[str, ...]
    samples: tuple[str, ...]
    points: tuple[int, ...]
    at: Measurements
    brdf: FloatArray
    agreement: Agreement
    same_tile: bool

    @property
    def runs(self) -> list[tuple[str, str, int, float, float]]:
        """Name, sample, number of points, level and its u of each run, a ratio to the first."""
        a = self.agreement
        levels = a.factors.tolist(), a.u_factors.tolist()
        return list(zip(self.names, self.samples, self.points, *levels, strict=True))

    @property
    def headline(self) -> str:
        """Verdict in one sentence."""
        whole, shape = self.agreement.whole, self.agreement.shape
        if whole.agrees:
            return "The runs agree within their uncertainty."
        if shape.agrees:
            return "The runs agree in their shape, and differ in their level."
        return "The runs differ by more than their uncertainty explains."

    @property
    def difference_in_u(self) -> FloatArray:
        """Difference (K, G) to the first run, in units of its standard uncertainty."""
        u = self.agreement.u_difference
        return np.divide(self.agreement.difference, u, out=np.zeros_like(u), where=u > 0)

    @property
    def largest(self) -> tuple[int, int]:
        """Run and geometry of the largest difference in u to the first run."""
        found = np.unravel_index(np.argmax(np.abs(self.difference_in_u)), self.brdf.shape)
        return int(found[0]), int(found[1])

    @property
    def repeatability(self) -> tuple[float, float]:
        """Relative scatter of the runs, rms over the geometries, and that which noise explains."""
        a = self.agreement
        scatter, u_scatter = (np.sqrt(np.mean(np.square(x))) for x in (a.scatter, a.u_scatter))
        return float(scatter), float(u_scatter)

    def angles(self, geometry: int) -> str:
        """Angles of one of the G geometries, in degrees."""
        at = self.at
        i, r, phi = (float(a[geometry]) for a in (at.theta_i_deg, at.theta_r_deg, at.dphi_deg))
        return f"θi {i:g}°, θr {r:g}°, Δφ {phi:g}°"


def level_text(level: float, u: float) -> str:
    """Return a run's level with its u; of the first, which has none, the number alone."""
    return format_value(level, u) if u else f"{level:g}"
