"""Directions and parameters at which tests of the models compare formulas."""

from __future__ import annotations

import math

import numpy as np

from analysis.models import Model
from instrument.geometry import FloatArray, Geometry


def random_directions(count: int, limit_deg: float = 85.0) -> Geometry:
    """Random geometries (N,) up to limit_deg from the normal, at any azimuth."""
    i, r, p = np.random.default_rng(20).random((3, count))
    return Geometry.from_degrees(theta_i=limit_deg * i, theta_r=limit_deg * r, dphi=360 * p)


def special_directions(count: int, limit_deg: float = 85.0) -> Geometry:
    """Random geometries (N,): many in the plane of incidence, at equal angles or near the limit."""
    random = np.random.default_rng(7)
    theta_i, theta_r = random.uniform(0, limit_deg, (2, count))
    dphi = random.uniform(0, 360, count)
    dphi[::5], dphi[1::5] = 0, 180
    theta_r[::3] = theta_i[::3]
    theta_i[1::4] = random.uniform(limit_deg - 10, limit_deg, theta_i[1::4].size)
    return Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)


def exchanged(geometry: Geometry, *, same_dphi: bool = False) -> Geometry:
    """The geometry with lamp and camera exchanged, for tests of reciprocity.

    dphi changes its sign; `same_dphi` keeps it, so that its rounding is the same, for surfaces that
    are symmetric about the plane of incidence.
    """
    return Geometry.from_degrees(
        theta_i=geometry.theta_r_deg,
        theta_r=geometry.theta_i_deg,
        dphi=geometry.dphi_deg if same_dphi else -geometry.dphi_deg,
    )


def unit_vectors(theta_i: float, theta_r: float, dphi: float) -> tuple[FloatArray, FloatArray]:
    """Unit vectors (3,) to lamp and camera; angles in radians."""
    lamp = np.array([math.sin(theta_i), 0, math.cos(theta_i)])
    across = math.sin(theta_r) * np.array([math.cos(dphi), math.sin(dphi)])
    return lamp, np.array([*across, math.cos(theta_r)])


def parameters_at(model: Model, part: float) -> dict[str, float]:
    """Every parameter at that part of its domain."""
    return {p.name: p.low + part * (p.high - p.low) for p in model.parameters}


_ENDS = [0.0, 1e-300, 1e-160, 1e-9, 1e-3, 30.0, 60.0, 89.0, 90 - 1e-6, 90 - 1e-13, 90.0]
_SIDES = [0.0, 360.0, 180.0, 90.0, 270.0, 1e-300, 1e-9, -1e-20, 180 - 1e-9, 180 + 3e-14, -180.0]


def extreme_directions(random: np.random.Generator, count: int) -> Geometry:
    """Geometries (N,): half of the angles at the ends of the domain or nearly equal."""
    theta = random.uniform(0, 90, (2, count))
    chosen = random.choice(_ENDS, (2, count))
    theta = np.where(random.random((2, count)) < 0.6, chosen, theta)
    nearly = np.minimum(theta[0] * (1 + 1e-15 * random.integers(-3, 4, count)), 90)
    theta[1] = np.where(random.random(count) < 0.4, nearly, theta[1])
    dphi = np.where(
        random.random(count) < 0.7, random.choice(_SIDES, count), random.uniform(0, 360, count)
    )
    return Geometry.from_degrees(theta_i=theta[0], theta_r=theta[1], dphi=dphi)


def extreme_parameters(random: np.random.Generator, model: Model) -> dict[str, float]:
    """Every parameter at or near an end of its domain, or anywhere in it."""
    values = {}
    for p in model.parameters:
        tiny = [5e-324, 1e-308, 1e-160, 1e-20] if p.low == 0 else [np.nextafter(p.low, 9)]
        inside = [p.default, random.uniform(p.low, p.high), np.nextafter(p.high, 0)]
        values[p.name] = float(random.choice([p.low, p.high, *inside, *tiny]))
    return values
