"""Defects of the lamp and of the light about the sample: warm-up, uneven beam, light from walls."""

from __future__ import annotations

import math

import numpy as np

from analysis.data.acceptance import disc_rule
from instrument.config.simulated.defects import LampDefects
from instrument.geometry import Brdf, FloatArray, Geometry, lamp_direction

_WALL_RINGS = 6  # 144 directions: exact to 1e-4 for matt surfaces


def warm_up_level(age_s: float, lamp: LampDefects) -> float:
    """Return the lamp's output, relative to that of the warm lamp, `age_s` after its start."""
    return 1.0 - lamp.warm_up * math.exp(-max(age_s, 0.0) / lamp.warm_up_s)


def beam_profile(
    points_mm: FloatArray, theta_i_deg: float, dphi_deg: float, lamp: LampDefects
) -> FloatArray:
    """Return the light at points (..., 3), in mm, relative to the middle of the lamp's beam.

    Of the shape (...); angles in degrees.
    """
    if lamp.spot_fwhm_mm is None:
        return np.ones(points_mm.shape[:-1])
    across = lamp_direction(theta_i_deg + 90.0, dphi_deg)
    sideways = np.cross(lamp_direction(theta_i_deg, dphi_deg), across)
    x, y = points_mm @ across - lamp.aim_x_mm, points_mm @ sideways - lamp.aim_y_mm
    profile: FloatArray = np.exp2(-4 * (x**2 + y**2) / lamp.spot_fwhm_mm**2)
    return profile


def wall_radiance(brdf: Brdf, theta_r_deg: float, wall_light: float) -> float:
    """Return the radiance of a surface in the light of the walls, for a lamp of irradiance 1.

    `wall_light`: irradiance by the walls, equally bright in all directions. `theta_r_deg` signed,
    a scalar. `brdf` is in 1/sr for geometries of any shape, and reciprocal.
    """
    if not wall_light:
        return 0.0
    nodes, weights = disc_rule(_WALL_RINGS)  # of the unit circle: area is projected solid angle
    theta_i = np.degrees(np.arcsin(np.hypot(nodes[:, 0], nodes[:, 1])))
    azimuth = np.degrees(np.arctan2(nodes[:, 1], nodes[:, 0]))
    view = np.full(theta_i.shape, abs(theta_r_deg))
    values = brdf(Geometry.from_degrees(theta_i=theta_i, theta_r=view, dphi=azimuth % 360.0))
    return float(wall_light * (np.asarray(values) @ weights))
