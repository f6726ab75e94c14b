"""Uniformity of a lamp's light over the sample: a polynomial in x and y of low order."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.calibration.level_series import Estimate
from instrument.errors import NotDetermined
from instrument.geometry import BoolArray, FloatArray, IntArray, lamp_direction

LOWEST_ORDER, HIGHEST_ORDER = 1, 4  # no light is even of which only the mean is known
CELLS = 16  # a side of the area
_FINER = 2  # orders: a beam that is symmetrical shows no more in the next one
_LEAST_FILLED = 0.6  # of the cells: a polynomial is not extrapolated far
_GRID = 33  # points a side, at which extremes are looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Mean light of the cells of a square area, arrays (n,): x_mm, y_mm, light relative, pixels."""

    x_mm: FloatArray
    y_mm: FloatArray
    light: FloatArray
    pixels: FloatArray
    side_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UniformityFit:
    """Polynomial of the light, 1 at the axis: sum of c * (x / half)^i * (y / half)^j.

    exponents: (terms, 2), i and j. coefficients: (terms,). covariance: (terms, terms), of the
    scatter about the fit. half_mm: half of the side of the area. residual: rms of the cells about
    the fit, relative. finer: polynomial of an order higher by `_FINER`, which shows what is missing
    in this one; None in that one itself.
    """

    exponents: IntArray
    coefficients: FloatArray
    covariance: FloatArray
    half_mm: float
    residual: float
    finer: UniformityFit | None = None

    @property
    def order(self) -> int:
        """Order of the polynomial."""
        return int(self.exponents.sum(axis=1).max())

    def light(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Return the light at points (n,), in mm, relative to that at the axis."""
        return np.asarray(_terms(x_mm, y_mm, self.half_mm, self.exponents) @ self.coefficients)

    def peak_to_valley(self, side_mm: float) -> Estimate:
        """Return the largest less the smallest light in a square about the axis, relative.

        Its u holds the difference from that of the finer polynomial.
        """
        steps = np.linspace(-side_mm / 2, side_mm / 2, _GRID)
        x, y = (values.ravel() for values in np.meshgrid(steps, steps))
        terms = _terms(x, y, self.half_mm, self.exponents)
        light = terms @ self.coefficients
        apart = terms[int(np.argmax(light))] - terms[int(np.argmin(light))]
        value, u = float(np.ptp(light)), float(np.sqrt(apart @ self.covariance @ apart))
        if self.finer is None:
            return Estimate(value, u)
        return Estimate(value, float(np.hypot(u, self.finer.peak_to_valley(side_mm).value - value)))


def irradiance(
    points_mm: FloatArray, theta_i_deg: float, dphi_deg: float, distance_mm: float
) -> FloatArray:
    """Return the irradiance by a point source at points (n, 2) of the plane, in mm; 1 at the axis.

    The source is `distance_mm` away in the direction of the angles: cosine over distance squared.
    """
    source = distance_mm * lamp_direction(theta_i_deg, dphi_deg)
    to_source = source - np.concatenate([points_mm, np.zeros((len(points_mm), 1))], axis=1)
    return np.asarray((distance_mm / np.linalg.norm(to_source, axis=1)) ** 3)


def cells_of(points_mm: FloatArray, light: FloatArray, used: BoolArray, side_mm: float) -> Cells:
    """Return the cells of a square about the axis from pixels: points (n, 2) in mm, light (n,).

    used: (n,), False for pixels that do not count. Raises `NotDetermined` if too few cells hold
    any.
    """
    inside = used & (np.abs(points_mm).max(axis=1) < side_mm / 2)
    x, y = points_mm[inside].T
    index = np.floor((points_mm[inside] / side_mm + 0.5) * CELLS).astype(np.int64) @ [CELLS, 1]
    count = np.bincount(index, minlength=CELLS**2)
    filled = count >= 0.5 * np.median(count[count > 0]) if x.size else count > 0
    if np.mean(filled) < _LEAST_FILLED:
        raise NotDetermined(
            f"lamp: the picture shows {100 * np.mean(filled):.2g} % of the tile's square of "
            f"{side_mm:.3g} mm; needed: {100 * _LEAST_FILLED:g} %. Give the size of the tile "
            "(--tile-mm), see where it lies (gonio grab), and see to axis_column_px, axis_row_px "
            "and field_width_mm of the rig file"
        )
    means = (
        np.bincount(index, weights=values, minlength=CELLS**2)[filled] / count[filled]
        for values in (x, y, light[inside])
    )
    x_mm, y_mm, mean = means
    return Cells(
        x_mm=x_mm, y_mm=y_mm, light=mean, pixels=count[filled].astype(np.float64), side_mm=side_mm
    )


def fit_uniformity(cells: Cells) -> UniformityFit:
    """Return the polynomial with the lowest Bayesian information criterion (Schwarz 1978)."""
    fits = [_fit(cells, order) for order in range(LOWEST_ORDER, HIGHEST_ORDER + 1)]
    best = min(fits, key=lambda scored: scored[0])[1]
    return replace(best, finer=_fit(cells, best.order + _FINER)[1])


def _fit(cells: Cells, order: int) -> tuple[float, UniformityFit]:
    """Return the criterion and the polynomial of an order, cells weighted by their pixels."""
    exponents = np.array([(n - j, j) for n in range(order + 1) for j in range(n + 1)])
    half_mm = cells.side_mm / 2
    terms = _terms(cells.x_mm, cells.y_mm, half_mm, exponents)
    root = np.sqrt(cells.pixels / cells.pixels.mean())
    weighted = terms * root[:, None]
    values = np.linalg.lstsq(weighted, cells.light * root, rcond=None)[0]
    rest = (cells.light - terms @ values) * root
    size, number = terms.shape
    scatter2 = float(rest @ rest) / max(size - number, 1)
    at_axis = float(values[0])
    # Light relative to that at the axis, whose own u goes into the others.
    to_relative = np.eye(number) / at_axis
    to_relative[:, 0] -= values / at_axis**2
    own = scatter2 * np.linalg.pinv(weighted.T @ weighted)
    fit = UniformityFit(
        exponents=exponents, coefficients=values / at_axis,
        covariance=to_relative @ own @ to_relative.T, half_mm=half_mm,
        residual=float(np.sqrt(scatter2)) / at_axis,
    )  # fmt: skip
    variance = max(float(rest @ rest) / size, 1e-30)
    return size * float(np.log(variance)) + number * float(np.log(size)), fit


def _terms(x_mm: FloatArray, y_mm: FloatArray, half_mm: float, exponents: IntArray) -> FloatArray:
    """Return the terms (n, terms) of the polynomial at points (n,) in mm."""
    x, y = np.asarray(x_mm) / half_mm, np.asarray(y_mm) / half_mm
    return np.asarray(x[:, None] ** exponents[:, 0] * y[:, None] ** exponents[:, 1])
