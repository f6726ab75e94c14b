"""Least-squares fit of albedo, sigma and ks in many cells at once, at geometries common to all.

For each sigma of a table the sums over the geometries are matrix products, ks is eliminated, and
chi2 is a polynomial of degree four in the albedo, whose minimum Newton's method finds. Over sigma
the least chi2 of the table and its neighbours give a polynomial, whose minimum is the fit. u: from
the curvature of chi2, the other parameters being free (GUM, S. Brandt: Data Analysis, chapter 9).

Several channels of a colour camera have one sigma: the sum of their chi2 is least there, and each
has an albedo and ks of its own.

Albedo and ks have no upper bound here, unlike in `analysis.fit`, so that noise about an albedo of 1
is not cut off. A negative ks counts as 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.sample_maps.sigma_table import SigmaTable
from instrument.geometry import BoolArray, FloatArray, IntArray

_NEWTON = 4  # steps: the first value is near, as two bounces are the smaller part
_POINTS, _MIDDLE = 5, 2  # of the polynomial over sigma
_COARSE, _MOVES = 3, 6  # every third value of the table finds the place; moves of the polynomial
_TO_COEFFICIENTS = np.linalg.inv(np.vander(np.arange(_POINTS) - _MIDDLE, increasing=True))
_TINY = 1e-300
_U_OF_KS = "variance_ks", "by_sigma_ks"


@dataclass(frozen=True, slots=True, kw_only=True)
class CellFits:
    """Fit of C cells: arrays (C,), NaN for a cell with no more geometries than parameters.

    albedo, ks: dimensionless; sigma_deg in degrees; u_*: standard uncertainties by the variances
    that the fit was given, NaN where a parameter is not determined: sigma on a bound of its domain.
    ks is 0 without a lobe. chi2, and count: geometries that the cell has.
    """

    albedo: FloatArray
    u_albedo: FloatArray
    sigma_deg: FloatArray
    u_sigma_deg: FloatArray
    ks: FloatArray
    u_ks: FloatArray
    chi2: FloatArray
    count: IntArray


class _Sums(NamedTuple):
    """Sums over the geometries, (S, C), of products of the parts, weighted by 1/variance."""

    once2: FloatArray
    once_twice: FloatArray
    twice2: FloatArray
    y_once: FloatArray
    y_twice: FloatArray
    y2: FloatArray


class _LobeSums(NamedTuple):
    """Sums, (S, C), with the lobe: by itself, with either part of the body, with the data."""

    lobe2: FloatArray
    once: FloatArray
    twice: FloatArray
    y: FloatArray


_Channel = tuple[_Sums, _LobeSums | None]


class _Profile(NamedTuple):
    """Least chi2 at each sigma (S, C), with albedo and ks there, and their variances."""

    chi2: FloatArray
    albedo: FloatArray
    ks: FloatArray
    variance_albedo: FloatArray
    variance_ks: FloatArray


def fit_cells(table: SigmaTable, brdf: NDArray[np.floating], variance: FloatArray) -> CellFits:
    """Fit C cells: `brdf` (K, C) in 1/sr with `variance` (K, C) in 1/sr^2.

    A value or variance that is NaN, or a variance of 0 or infinity, is left out of its cell.
    """
    (fits,) = fit_channels(table, [brdf], [variance])
    return fits


def fit_channels(
    table: SigmaTable,
    brdf: Sequence[NDArray[np.floating]],
    variance: Sequence[FloatArray],
    own_share: Sequence[FloatArray] | None = None,
) -> list[CellFits]:
    """Fit C cells in several channels, as `fit_cells` does in one; sigma, chi2, count are common.

    own_share: (C,) each, dimensionless factor of the variance of albedo and ks at a given sigma,
    by which that of a channel alone differs from what `variance` states of it beside others.
    """
    usable = [
        np.isfinite(y) & np.isfinite(v) & (v > 0) for y, v in zip(brdf, variance, strict=True)
    ]
    counts = [own.sum(axis=0) for own in usable]
    poor = np.any([count <= len(table.parameters) for count in counts], axis=0)
    channels = []
    for y, v, own in zip(brdf, variance, usable, strict=True):
        weight = np.divide(1.0, v, out=np.zeros(v.shape), where=own & ~poor)
        channels.append(_sums(table, np.where(own, y, 0.0).astype(np.float64), weight))
    shares = own_share or [np.ones(poor.shape) for _ in channels]
    fits = _minimum(table, channels)
    _without_dark_lobes(table, channels, fits)
    for own, share in zip(fits, shares, strict=True):
        _scale_u(own, share)
        for values in own.values():
            values[poor] = np.nan
    count = np.sum(counts, axis=0).astype(np.int64)
    return [CellFits(**own, count=count) for own in fits]


def _scale_u(own: dict[str, FloatArray], share: FloatArray) -> None:
    """Join the two parts of u of albedo and ks: at a given sigma, and by the u of sigma."""
    for name in ("albedo", "ks"):
        variance, by_sigma = own.pop(f"variance_{name}"), own.pop(f"by_sigma_{name}")
        own[f"u_{name}"] = np.sqrt(np.maximum(variance, 0) * share + by_sigma**2)


def _without_dark_lobes(
    table: SigmaTable, channels: Sequence[_Channel], fits: Sequence[dict[str, FloatArray]]
) -> None:
    """Fit cells with a negative ks again, in place, without a lobe in those channels."""
    if table.lobe is None:
        return
    dark = np.array([own["ks"] < 0 for own in fits])
    if not dark.any():
        return
    for pattern in np.unique(dark[:, dark.any(axis=0)], axis=1).T:
        cells = np.flatnonzero(np.all(dark == pattern[:, np.newaxis], axis=0))
        parts = [_of_cells(c, cells, lit=not p) for c, p in zip(channels, pattern, strict=True)]
        for own, again, p in zip(fits, _minimum(table, parts), pattern, strict=True):
            for name, values in again.items():
                if not (p and name in _U_OF_KS):  # that of the value which is less than 0
                    own[name][cells] = values


def _sums(table: SigmaTable, y: FloatArray, weight: FloatArray) -> tuple[_Sums, _LobeSums | None]:
    wy, once, twice, lobe = weight * y, table.once, table.twice, table.lobe
    body = _Sums(
        once**2 @ weight,
        (once * twice) @ weight,
        twice**2 @ weight,
        once @ wy,
        twice @ wy,
        np.sum(wy * y, axis=0)[np.newaxis],
    )
    if lobe is None:
        return body, None
    return body, _LobeSums(
        np.maximum(lobe**2 @ weight, _TINY), (lobe * once) @ weight, (lobe * twice) @ weight,
        lobe @ wy,
    )  # fmt: skip


def _without_lobe(sums: _Sums, lobe: _LobeSums) -> _Sums:
    """Return the sums with ks eliminated: at its best value for each albedo."""
    by = 1 / lobe.lobe2
    return _Sums(
        sums.once2 - lobe.once**2 * by,
        sums.once_twice - lobe.once * lobe.twice * by,
        sums.twice2 - lobe.twice**2 * by,
        sums.y_once - lobe.y * lobe.once * by,
        sums.y_twice - lobe.y * lobe.twice * by,
        sums.y2 - lobe.y**2 * by,
    )


def _profile(sums: _Sums, lobe: _LobeSums | None, steps: int = _NEWTON) -> _Profile:
    """Return the least chi2 at each sigma, over albedo and ks."""
    s = sums if lobe is None else _without_lobe(sums, lobe)
    linear, cubic = s.once2 - 2 * s.y_twice, 2 * s.twice2
    a = s.y_once / np.maximum(s.once2, _TINY)
    for _ in range(steps):
        slope = ((cubic * a + 3 * s.once_twice) * a + linear) * a - s.y_once
        bend = (3 * cubic * a + 6 * s.once_twice) * a + linear
        a = a - slope / np.where(bend > 0, bend, np.maximum(s.once2, _TINY))
    chi2 = s.y2 + a * (-2 * s.y_once + a * (linear + a * (2 * s.once_twice + a * s.twice2)))
    bend = s.once2 + a * (4 * s.once_twice + 4 * a * s.twice2)  # of the model: residuals apart
    variance = 1 / np.maximum(bend, _TINY)
    if lobe is None:
        return _Profile(chi2, a, np.zeros(a.shape), variance, np.zeros(a.shape))
    with_a = lobe.once + 2 * a * lobe.twice
    ks = (lobe.y - a * (lobe.once + a * lobe.twice)) / lobe.lobe2
    variance_ks = 1 / lobe.lobe2 + (with_a / lobe.lobe2) ** 2 * variance
    return _Profile(chi2, a, ks, variance, variance_ks)


def _minimum(table: SigmaTable, channels: Sequence[_Channel]) -> list[dict[str, FloatArray]]:
    """Return values and u of each channel by name, (C,), at the least chi2 over sigma.

    A polynomial goes through five neighbours in the table, chosen by every third; where its least
    value is not near their middle, it is moved.
    """
    first = _first_of_five(table, channels)
    place, found = _of_five(table, channels, first)
    for _ in range(_MOVES):
        off = np.abs(place - first - _MIDDLE) > 1
        moved = _limited(table, np.rint(place).astype(np.int64) - _MIDDLE)
        cells = np.flatnonzero(off & (moved != first))
        if not cells.size:
            break
        first[cells] = moved[cells]
        parts = [_of_cells(channel, cells) for channel in channels]
        place[cells], again = _of_five(table, parts, moved[cells])
        for own, other in zip(found, again, strict=True):
            for name, values in other.items():
                own[name][cells] = values
    return found


def _of_cells(channel: _Channel, cells: IntArray, *, lit: bool = True) -> _Channel:
    """Return the sums of some cells (N,); without those of a lobe if it is not `lit`."""
    sums, lobe = channel
    part = None if lobe is None or not lit else _LobeSums(*(a[:, cells] for a in lobe))
    return _Sums(*(a[:, cells] for a in sums)), part


def _total(chi2: Sequence[FloatArray]) -> FloatArray:
    """Return the sum of the channels' chi2, (S, C) each."""
    return reduce(np.add, chi2)


def _first_of_five(table: SigmaTable, channels: Sequence[_Channel]) -> IntArray:
    """Return the first (C,) of five values in the table about the least chi2 of every third."""
    every = slice(None, None, _COARSE)
    chi2 = _total([_profile(*_rows(*own, every), steps=2).chi2 for own in channels])
    least = np.argmin(chi2, axis=0)
    inner = np.clip(least, 1, len(chi2) - 2)
    before, own, after = (chi2[inner + n, np.arange(inner.size)] for n in (-1, 0, 1))
    bend = before + after - 2 * own
    t = np.divide(before - after, 2 * bend, out=np.zeros(bend.shape), where=bend > 0)
    place = np.where(least == inner, inner + np.clip(t, -1, 1), least)
    return _limited(table, np.rint(_COARSE * place).astype(np.int64) - _MIDDLE)


def _rows(sums: _Sums, lobe: _LobeSums | None, rows: Any) -> tuple[_Sums, _LobeSums | None]:
    """Select rows of sigma in all sums; that of the data's squares is of every sigma."""
    body = sums._replace(**{name: getattr(sums, name)[rows] for name in _Sums._fields[:-1]})
    return body, None if lobe is None else _LobeSums(*(a[rows] for a in lobe))


def _limited(table: SigmaTable, first: IntArray) -> IntArray:
    """Keep five values from `first` (C,) on in the table, which goes on below a sigma of 0."""
    lowest = -_MIDDLE if table.even else 0
    return np.clip(first, lowest, table.sigma_deg.size - _POINTS)


def _of_five(
    table: SigmaTable, channels: Sequence[_Channel], first: IntArray
) -> tuple[FloatArray, list[dict[str, FloatArray]]]:
    """Return the place (C,) of sigma in the table, and values of each channel by name, (C,).

    Of the polynomial through five values from `first` (C,).
    """
    rows, cells = np.abs(first + np.arange(_POINTS)[:, np.newaxis]), np.arange(first.size)
    profiles = [_profile(*_rows(*own, (rows, cells))) for own in channels]
    chi2 = _total([own.chi2 for own in profiles])
    low = np.maximum(-first, 0) * 1.0
    high = np.minimum(table.sigma_deg.size - 1 - first, _POINTS - 1) * 1.0
    t, bend = _least(chi2, low, high)
    place = first + t
    sigma, by_place = table.sigma_at(place)
    on_bound = (place <= 0) | (place >= table.sigma_deg.size - 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u_place = np.sqrt(2 / np.where((bend > 0) & ~on_bound, bend, np.nan))
    common = {
        "sigma_deg": sigma,
        "u_sigma_deg": u_place * by_place,
        "chi2": np.maximum(_interpolated(chi2, t)[0], 0.0),
    }
    return place, [
        {**{n: a.copy() for n, a in common.items()}, **_at(own, t, u_place)} for own in profiles
    ]


def _at(own: _Profile, t: FloatArray, u_place: FloatArray) -> dict[str, FloatArray]:
    """Return albedo and ks at places t (C,) with the two parts of their u, see `_scale_u`."""
    found = {}
    for name in ("albedo", "ks"):
        found[name], by_t = _interpolated(getattr(own, name), t)
        found[f"variance_{name}"], _ = _interpolated(getattr(own, f"variance_{name}"), t)
        found[f"by_sigma_{name}"] = np.nan_to_num(by_t * u_place)
    return found


def _least(chi2: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return place (C,) and second derivative (C,) of the least of a polynomial of degree four.

    It goes through chi2 (5, C); low and high (C,): the range of the place, in steps from the first.
    """
    c = _TO_COEFFICIENTS @ chi2
    inner = np.argmin(chi2, axis=0) * 1.0 - _MIDDLE
    least, most = np.maximum(low - _MIDDLE, inner - 1), np.minimum(high - _MIDDLE, inner + 1)
    t = np.clip(inner, least, most)
    for _ in range(_NEWTON + 1):
        slope, bend = _slope(c, t), _bend(c, t)
        step = np.clip(slope / np.where(bend > 0, bend, np.inf), -1.0, 1.0)
        t = np.clip(t - step, least, most)
    return t + _MIDDLE, _bend(c, t)


def _slope(c: FloatArray, x: FloatArray) -> FloatArray:
    return np.asarray(c[1] + x * (2 * c[2] + x * (3 * c[3] + x * 4 * c[4])))


def _bend(c: FloatArray, x: FloatArray) -> FloatArray:
    return np.asarray(2 * c[2] + x * (6 * c[3] + x * 12 * c[4]))


def _interpolated(values: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return value and derivative, (C,) each, at t (C,) of the polynomial through (5, C)."""
    c, x = _TO_COEFFICIENTS @ values, t - _MIDDLE
    value = c[0] + x * (c[1] + x * (c[2] + x * (c[3] + x * c[4])))
    return value, _slope(c, x)


def determined(fits: CellFits) -> BoolArray:
    """Return True for each cell (C,) whose sigma, in degrees, has a standard uncertainty."""
    return np.isfinite(fits.u_sigma_deg)
