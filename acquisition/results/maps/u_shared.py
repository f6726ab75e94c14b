"""Uncertainty of the cells' parameters by what all cells share: tile, lamp, angles, height."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from acquisition.results.maps.mean_curve import MeanCurve
from analysis.models import MODELS, Model
from analysis.sample_maps.block_fit import CellData
from instrument.geometry import BoolArray, FloatArray

_NODES = 9  # quantiles of sigma, between which u is worked out
_SIGMA_DEG = 1.0, 59.0  # inside of every model's domain
_SMOOTHED = 5  # cells along a side, over which a slope of the map is taken


@dataclass(frozen=True, slots=True)
class UnknownHeight:
    """Height of the surface as far as it is not known: u in mm, and in the rig's placement.

    theta_r_deg: (K,), at which it shifts the picture.
    """

    u_mm: float
    in_placement: float
    theta_r_deg: FloatArray


def u_shared(
    maps: Mapping[str, FloatArray], curve: MeanCurve, data: CellData, height: UnknownHeight
) -> dict[str, FloatArray]:
    """Return u (rows, columns) of each parameter, in its unit, from its maps (rows, columns).

    Worked out at some values of sigma, each with the median of the other parameters about it, and
    linear between them. A surface off its place also mixes neighbouring cells: by the slope of the
    map along x, which is the direction of the shift.
    """
    names, sigma = tuple(maps), maps["sigma_deg"]
    tangent = np.tan(np.radians(height.theta_r_deg))
    nodes, u, mixing = [], [], []
    for values in _usual(maps, MODELS[curve.fit.model]):
        found = curve.response(values, data.variance)
        nodes.append(values["sigma_deg"])
        u.append(curve.u_shared(found, height.in_placement))
        mixing.append(found.inverse @ (tangent[:, np.newaxis] * found.by_parameter))
    order = np.argsort(nodes)
    at = np.array(nodes)[order]
    shared, mixed = np.array(u)[order], np.array(mixing)[order]
    slopes = [_slope(maps[name], data) for name in names]
    total = {}
    for k, name in enumerate(names):
        moved = np.zeros(sigma.shape)
        for n, slope in enumerate(slopes):
            moved += np.interp(sigma, at, mixed[:, k, n]) * slope
        total[name] = np.hypot(np.interp(sigma, at, shared[:, k]), height.u_mm * moved)
    return total


def _usual(maps: Mapping[str, FloatArray], model: Model) -> Iterator[dict[str, float]]:
    """Yield the parameters of usual cells between quantiles of sigma, within the model's domain."""
    sigma = maps["sigma_deg"]
    known = np.isfinite(sigma)
    ends = np.quantile(sigma[known], np.linspace(0, 1, _NODES)).tolist()
    for low, high in pairwise(ends):
        own: BoolArray = known & (sigma >= low) & (sigma <= high)
        values = {
            p.name: float(np.clip(np.median(maps[p.name][own]), p.low, p.high))
            for p in model.parameters
        }
        yield {**values, "sigma_deg": float(np.clip(values["sigma_deg"], *_SIGMA_DEG))}


def _slope(values: FloatArray, data: CellData) -> FloatArray:
    """Return the derivative of a map (rows, columns) along x, per mm, smoothed."""
    import cv2

    filled = np.where(np.isfinite(values), values, np.nanmedian(values))
    smooth = cv2.blur(filled, (_SMOOTHED, _SMOOTHED), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(np.gradient(smooth, data.x_mm, axis=1))
