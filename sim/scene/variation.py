"""Variation of a simulated sample: the share of its other parameters at each place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from instrument.config.protocol import Sample
from instrument.config.simulated.sample import Variation
from instrument.geometry import FloatArray
from instrument.pinhole import rectangle_mm

# Shares at which the radiance of a gradient is rendered; between them it is a polynomial.
_GRADIENT = (0.0, 0.146447, 0.5, 0.853553, 1.0)


def shares_to_render(variation: Variation | None) -> tuple[float, ...]:
    """Return the shares of the other parameters at which the radiance is computed."""
    if variation is None:
        return (0.0,)
    return _GRADIENT if variation.pattern == "gradient" else (0.0, 1.0)


def share_at(points_mm: FloatArray, variation: Variation, sample: Sample) -> FloatArray:
    """Return the share (...) of the other parameters, 0 to 1, at points (..., 2) in mm."""
    x, y = points_mm[..., 0], points_mm[..., 1]
    if variation.pattern == "halves":
        return np.asarray(x > 0, dtype=np.float64)
    if variation.pattern == "gradient":
        return np.asarray(np.clip(0.5 + x / sample.width_mm, 0.0, 1.0))
    half = variation.size_mm / 2
    return np.asarray((np.abs(x) <= half) & (np.abs(y) <= half), dtype=np.float64)


def region_mm(variation: Variation, sample: Sample) -> FloatArray:
    """Return the corners (4, 2) in mm of the places with the other parameters; not of a gradient.

    A pixel on an edge of them holds both surfaces, by the share of it that each covers.
    """
    if variation.pattern == "halves":
        # Twice the half, as the sample's own outline cuts it.
        middle = np.array([sample.width_mm / 2, 0.0])
        return np.asarray(rectangle_mm(sample.width_mm, 2 * sample.height_mm) + middle)
    return rectangle_mm(variation.size_mm, variation.size_mm)


def blended(radiance: Sequence[NDArray[np.floating]], share: FloatArray) -> FloatArray:
    """Return the radiance at each place's share, both (rows, columns), by a polynomial.

    radiance: at each of `shares_to_render`, in one unit.
    """
    nodes = _GRADIENT if len(radiance) == len(_GRADIENT) else (0.0, 1.0)
    total = np.zeros(share.shape)
    for own, values in zip(nodes, radiance, strict=True):
        others = [node for node in nodes if node != own]
        total += values * np.prod([(share - n) / (own - n) for n in others], axis=0)
    return total
