"""Effects of how surfaces lie and axes point: tilt, zeros, and the age of the white tile.

A tilt changes the angles, which the model's gradient tells, and the irradiance cos(theta_i). It
does not change the mean radiance of the window to first order: the patch that it cuts out is as
much too wide on one side as it is too narrow on the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from instrument.geometry import FloatArray

TILT, TILT_ACROSS = "sample tilt", "sample tilt across"
TILE_TILT, TILE_TILT_ACROSS = "white tile tilt", "white tile tilt across"
ZEROS = {"theta_i": "zero of theta_i", "dphi": "zero of dphi", "theta_r": "zero of theta_r"}
TILE_AGED = "white tile ageing"

_NEAR_NORMAL = 0.1  # least tangent of a polar angle: nearer, the azimuth no longer matters


def surface_effects(readings: Readings) -> Iterator[Effect]:
    """Yield the effects whose size or u the rig file states."""
    lines = readings.rig.uncertainty
    if lines.u_tilt_deg:
        yield _tilt(readings, lines.u_tilt_deg)
    if lines.u_tilt_across_deg:
        yield _tilt_across(readings, lines.u_tilt_across_deg)
    none = np.zeros(len(readings.points))
    if readings.absolute:
        brighter, brighter_across = _irradiance(readings)
        if lines.u_tile_tilt_deg:
            yield Effect(name=TILE_TILT, by_one=-brighter, u=lines.u_tile_tilt_deg)
        if lines.u_tile_tilt_across_deg:
            u = lines.u_tile_tilt_across_deg
            yield Effect(name=TILE_TILT_ACROSS, by_one=-brighter_across, u=u)
        if lines.tile_aged or lines.u_tile_aged:
            size, u = lines.tile_aged, lines.u_tile_aged
            yield Effect(name=TILE_AGED, by_one=none + 1, size=size, u=u)
    for axis, name in ZEROS.items():
        if u := getattr(lines, f"u_zero_{axis}_deg"):
            turned: dict[str, Any] = {f"{axis}_deg": none + 1}
            yield Effect(name=name, by_one=none, u=u, **turned)


def _irradiance(readings: Readings) -> tuple[FloatArray, FloatArray]:
    """Relative change of the irradiance, (N,) each, by 1 deg of tilt in the plane and across it."""
    theta_i, _, dphi = np.radians(readings.angles_deg())
    slope = np.tan(theta_i) * np.radians(1.0)
    return slope * np.cos(dphi), -slope * np.sin(dphi)


def _cotangent(angle: FloatArray) -> FloatArray:
    """Cotangent of angles (N,) in radians, of either sign; 0 near the normal."""
    tangent = np.tan(angle)
    far = np.abs(tangent) > _NEAR_NORMAL
    return np.divide(1.0, tangent, out=np.zeros(angle.size), where=far)


def _tilt(readings: Readings, u_deg: float) -> Effect:
    """Lean of the normal towards positive theta_r: the camera is nearer to it, and the lamp too."""
    theta_i, _, dphi = np.radians(readings.angles_deg())
    return Effect(
        name=TILT,
        by_one=_irradiance(readings)[0],
        u=u_deg,
        theta_i_deg=-np.cos(dphi),
        theta_r_deg=-np.ones(dphi.size),
        dphi_deg=np.sin(dphi) * _cotangent(theta_i),
    )


def _tilt_across(readings: Readings, u_deg: float) -> Effect:
    """Lean of the normal towards the y axis, from which the lamp's azimuth counts backwards."""
    theta_i, theta_r, dphi = np.radians(readings.angles_deg())
    return Effect(
        name=TILT_ACROSS,
        by_one=_irradiance(readings)[1],
        u=u_deg,
        theta_i_deg=np.sin(dphi),
        dphi_deg=np.cos(dphi) * _cotangent(theta_i) - _cotangent(theta_r),
    )
