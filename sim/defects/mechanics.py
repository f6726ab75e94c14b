"""Defects of the mechanics: a surface that leans or lies aside, axes that err, a beam that bends.

Coordinates as in `instrument.geometry`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from instrument.config.simulated.defects import AxisDefects, BeamDefects, Placement
from instrument.geometry import FloatArray, camera_direction, lamp_direction
from instrument.pinhole import Pinhole


@dataclass(frozen=True, slots=True, kw_only=True)
class SeenAngles:
    """Angles in degrees from the normal of the mounted surface.

    turn_deg: of the camera's plane about that normal, from the surface's x axis towards its y axis.
    """

    theta_i: float
    dphi: float
    theta_r: float
    turn_deg: float = 0.0


def leaning(angles: SeenAngles, tilt_deg: float) -> SeenAngles:
    """Return the angles from a normal that leans by `tilt_deg` to the side of positive theta_r."""
    if not tilt_deg:
        return angles
    x, y, z = lamp_direction(angles.theta_i, angles.dphi)
    tilt = np.radians(tilt_deg)
    across, up = x * np.cos(tilt) - z * np.sin(tilt), x * np.sin(tilt) + z * np.cos(tilt)
    return SeenAngles(
        theta_i=float(np.degrees(np.arctan2(np.hypot(across, y), up))),
        dphi=float(np.degrees(np.arctan2(-y, across))),
        theta_r=angles.theta_r - tilt_deg,
    )


def leaning_across(angles: SeenAngles, tilt_deg: float) -> SeenAngles:
    """Return the angles from a normal that leans by `tilt_deg` towards positive y."""
    if not tilt_deg:
        return angles
    own = _axes_leaning_across(tilt_deg)
    side = math.copysign(1.0, angles.theta_r)
    camera = camera_direction(angles.theta_r) @ own
    lamp = lamp_direction(angles.theta_i, angles.dphi) @ own
    turn = math.atan2(side * camera[1], side * camera[0])
    in_plane = lamp[0] * math.cos(turn) + lamp[1] * math.sin(turn)
    sideways = lamp[1] * math.cos(turn) - lamp[0] * math.sin(turn)
    return SeenAngles(
        theta_i=math.degrees(math.atan2(math.hypot(lamp[0], lamp[1]), lamp[2])),
        dphi=math.degrees(math.atan2(-sideways, in_plane)),
        theta_r=side * math.degrees(math.atan2(math.hypot(camera[0], camera[1]), camera[2])),
        turn_deg=math.degrees(turn),
    )


def _axes_leaning_across(tilt_deg: float) -> FloatArray:
    """Return the axes of a surface that leans towards positive y, as columns (3, 3)."""
    c, s = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def leaning_homography(
    pinhole: Pinhole, theta_r_deg: float, height_mm: float, tilt_across_deg: float
) -> FloatArray:
    """Return the homography (3, 3) from a surface in mm, that leans towards y, to the picture.

    `theta_r_deg`: from the normal in the camera's plane. `height_mm`: along the surface's normal.
    """
    flat = pinhole.homography(theta_r_deg, height_mm)
    if not tilt_across_deg:
        return flat
    level = pinhole.homography(theta_r_deg, 0.0)
    space = np.column_stack(
        [level[:, :2], pinhole.homography(theta_r_deg, 1.0)[:, 2] - level[:, 2]]
    )
    own = space @ _axes_leaning_across(tilt_across_deg)
    matrix: FloatArray = np.column_stack([own[:, :2], level[:, 2] + height_mm * own[:, 2]])
    return matrix


def placement(shift_x_mm: float, shift_y_mm: float, turn_deg: float) -> FloatArray:
    """Return the matrix (3, 3) from points (x, y, 1), in mm, of a surface to the table."""
    turn = np.radians(turn_deg)
    c, s = float(np.cos(turn)), float(np.sin(turn))
    return np.array([[c, -s, shift_x_mm], [s, c, shift_y_mm], [0.0, 0.0, 1.0]])


def half_turned(own: Placement) -> Placement:
    """Return the place of a surface that was turned by half a turn in its own plane."""
    opposite = ("tilt_deg", "tilt_across_deg", "shift_x_mm", "shift_y_mm")
    turn_deg = own.turn_deg - math.copysign(180.0, own.turn_deg)
    changed = {"turn_deg": turn_deg} | {name: -getattr(own, name) for name in opposite}
    return own.model_copy(update=changed)


def turned(points_mm: FloatArray, turn_deg: float) -> FloatArray:
    """Return points (..., 2) in mm in axes that are turned by `turn_deg`, from x towards y."""
    if not turn_deg:
        return points_mm
    turned_mm: FloatArray = points_mm @ placement(0.0, 0.0, turn_deg)[:2, :2]
    return turned_mm


def axis_error_deg(angle_deg: float, defects: AxisDefects, phase: float) -> float:
    """Return true angle minus shown angle of an axis; `phase` of its cycle in turns, 0 to 1."""
    cycle = math.sin(math.radians(angle_deg) + 2 * math.pi * phase)
    return defects.zero_deg + defects.cyclic_deg * cycle


def picture_shift(theta_r_deg: float, beam: BeamDefects, phase: float) -> FloatArray:
    """Return the matrix (3, 3) that moves pixels (column, row, 1) with a beam that errs.

    `phase` of the wobble in turns, 0 to 1.
    """
    angle = math.radians(theta_r_deg)
    columns = beam.sag_px * math.sin(angle)
    rows = beam.wobble_px * math.sin(angle + 2 * math.pi * phase)
    return placement(columns, rows, 0.0)
