"""Range of a chart's value axis, from the data: points with their u, and lines of the models."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.report.sweeps import PlottedSweep
from instrument.geometry import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LOG_RATIO = 40.0  # largest over smallest value above which the scale is logarithmic
_ZERO_RATIO = 2.0  # largest over smallest value above which the axis begins at zero
_MARGIN = 0.08  # of the range, above and below
_LEAST_RANGE = 0.004  # of the largest value: rounding of a constant is no structure

Scaled = Sequence[tuple[PlottedSweep, float]]  # a sweep, and the unit of its values


def set_value_axis(ax: Axes, scaled: Scaled) -> None:
    """Set linear limits that fill the chart, or a logarithmic scale for a large range.

    The axis begins at zero where the values differ by more than a factor of 2. A flagged outlier
    does not compress the others: it may lie outside the axes.
    """
    good = [_bars(s) / unit for s, unit in scaled]
    lines = [s.lines[0] / unit for s, unit in scaled if s.lines]
    low, high = _extent([*good, *lines])
    flagged_low, flagged_high = _extent([*good, *lines, *(s.value / unit for s, unit in scaled)])
    if not np.isfinite(flagged_low):
        return
    if not np.isfinite(low):
        low, high = flagged_low, flagged_high
    if low > 0 and high > _LOG_RATIO * low:
        _log_axis(ax, low / 1.5, high * 1.5)
        return
    room = high - low if low > 0 else high
    low, high = max(flagged_low, low - 0.5 * room), min(flagged_high, high + 0.5 * room)
    ax.set_ylim(*_linear_limits(low, high))


def _bars(sweep: PlottedSweep) -> FloatArray:
    """Ends of the error bars of unflagged points; of a value within its u, the value alone."""
    value, u = sweep.value[~sweep.flagged], sweep.u[~sweep.flagged]
    u = np.where(u < np.abs(value), u, 0.0)
    return np.concatenate([value - u, value + u])


def _linear_limits(low: float, high: float) -> tuple[float, float]:
    if low <= 0 or high > _ZERO_RATIO * low:
        low = min(low, 0.0)
        return low + _MARGIN * min(low, 0.0), high + _MARGIN * (high - low) + (high <= low)
    middle, half = 0.5 * (low + high), 0.5 * max(high - low, _LEAST_RANGE * high)
    return middle - (1 + 2 * _MARGIN) * half, middle + (1 + 2 * _MARGIN) * half


def set_symmetric_axis(ax: Axes, arrays: Sequence[FloatArray], least: float) -> float:
    """Set limits about zero that hold all finite values of arrays (N,), at least ±`least`.

    Values and limit have the unit of the axis; returns the limit.
    """
    low, high = _extent(arrays)
    largest = max(abs(low), abs(high)) if np.isfinite(low) else 0.0
    limit = max(least, 1.15 * largest)
    ax.set_ylim(-limit, limit)
    return limit


def _log_axis(ax: Axes, low: float, high: float) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    ax.set_yscale("log")
    ax.set_ylim(low, high)
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 1000 * low else (1.0,)))
    ax.yaxis.set_minor_locator(NullLocator())
    ax.yaxis.set_major_formatter("{x:g}")


def _extent(arrays: Sequence[FloatArray]) -> tuple[float, float]:
    """Smallest and largest finite value, NaN if there is none."""
    values = np.concatenate(arrays) if arrays else np.array([])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (np.nan, np.nan)
