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
    each run has. at: the points of the first run at the G geometries. brdf: (K, G) in 1/sr; with
    relative runs, on the level of the first absolute one; without one, relative to the mean of the
    first run. same_tile: one white tile gave all runs their scale. relative: True for each run
    without a level.
    """

    names: tuple[str, ...]
    samples: tuple[str, ...]
    points: tuple[int, ...]
    at: Measurements
    brdf: FloatArray
    agreement: Agreement
    same_tile: bool
    relative: tuple[bool, ...]

    @property
    def shape_only(self) -> bool:
        """True if a run has no level, so that the shapes alone are compared."""
        return any(self.relative)

    @property
    def unit(self) -> str:
        """Unit of the values in brackets, empty where all are relative."""
        return "" if all(self.relative) else " (1/sr)"

    @property
    def runs(self) -> list[tuple[str, str, int, float | None, float | None]]:
        """Name, sample, number of points, level and its u of each run, a ratio to the first.

        The level is None where shapes alone are compared.
        """
        a = self.agreement
        pairs: list[tuple[float | None, float | None]] = [(None, None)] * len(self.names)
        if not self.shape_only:
            pairs = list(zip(a.factors.tolist(), a.u_factors.tolist(), strict=True))
        named = zip(self.names, self.samples, self.points, pairs, strict=True)
        return [(name, sample, points, *level) for name, sample, points, level in named]

    @property
    def headline(self) -> str:
        """Verdict in one sentence."""
        whole, shape = self.agreement.whole, self.agreement.shape
        if self.shape_only:
            said = "agree" if shape.agrees else "differ by more than their uncertainty explains"
            return f"The runs {said} in their shape; their levels were not compared."
        if whole.agrees:
            return "The runs agree within their uncertainty."
        if shape.agrees:
            return "The runs agree in their shape, and differ in their level."
        return "The runs differ by more than their uncertainty explains."

    @property
    def agrees(self) -> bool:
        """True if the runs agree in all that was compared."""
        a = self.agreement
        return a.shape.agrees if self.shape_only else a.whole.agrees

    @property
    def why_no_level(self) -> str:
        """Sentence about the runs without a level, empty if all have one."""
        if not self.shape_only:
            return ""
        pairs = zip(self.names, self.relative, strict=True)
        names = ", ".join(name for name, relative in pairs if relative)
        return (
            f"measured without a white tile, so without a level: {names}; all values are brought "
            "to one level, for each lamp setting of these runs"
        )

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


def level_text(level: float | None, u: float | None) -> str:
    """Return a run's level with its u; of the first, which has none, the number alone."""
    if level is None:
        return "not compared"
    return format_value(level, u) if u else f"{level:g}"
