"""Effect of polarised light, or of a camera that prefers one polarisation.

Light that comes out of the sample's inside has passed its surface twice, and light of the mirror
side is reflected by facets; both prefer one polarisation, by Fresnel's formulas for an index of
1.5, which is near that of most dielectrics. The tile is a perfect depolariser. Which part of a
value the facets reflect is estimated from the values themselves, by a quick fit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from analysis.models.smooth.fresnel import reflectances
from instrument.geometry import FloatArray, Geometry, camera_direction, lamp_direction

LAMP, CAMERA = "polarisation of the lamp", "polarisation of the camera"
_INDEX = 1.5


def polarisation_effects(readings: Readings) -> Iterator[Effect]:
    """Yield the effects whose u the rig file states."""
    lines = readings.rig.uncertainty
    if not (lines.u_polarisation_lamp or lines.u_polarisation_camera):
        return
    theta_i, theta_r, dphi = readings.angles_deg()
    to_lamp, to_camera = lamp_direction(theta_i, dphi), camera_direction(theta_r)
    azimuth = np.radians(-dphi)
    across_lamp = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros(dphi.size)], axis=-1)
    across_camera = np.broadcast_to([0.0, 1.0, 0.0], across_lamp.shape)
    facets = _share_of_facets(readings)
    excess = _reflected_excess(to_lamp, to_camera)
    for name, u, theta, across, to in (
        (LAMP, lines.u_polarisation_lamp, theta_i, across_lamp, to_lamp),
        (CAMERA, lines.u_polarisation_camera, theta_r, across_camera, to_camera),
    ):
        if u:
            mirrored = excess * _alignment(np.cross(to_lamp, to_camera), across, to)
            body = _transmitted_excess(np.abs(theta))
            yield Effect(name=name, by_one=(1 - facets) * body + facets * mirrored, u=u)


def _share_of_facets(readings: Readings) -> FloatArray:
    """Share of the values, (N,), that the facets of the surface reflect, by a quick fit.

    It is 0 where the fit has no value, and everywhere if there are too few points to tell.
    """
    fit = readings.fit
    if fit is None:
        return np.zeros(readings.value.size)
    theta_i, theta_r, dphi = readings.angles_deg()
    known = np.isfinite(readings.value) & (readings.value > 0)
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    return np.where(known, fit.share_of_facets(geometry), 0.0)


def _transmitted_excess(theta_deg: FloatArray) -> FloatArray:
    """Relative excess, (N,), of horizontal light that passes the surface at these angles."""
    para, perp = reflectances(np.radians(theta_deg), _INDEX)
    return (para - perp) / np.maximum(2 - para - perp, 1e-12)


def _reflected_excess(to_lamp: FloatArray, to_camera: FloatArray) -> FloatArray:
    """Relative excess, (N,), of light across the plane of two directions (N, 3), by a facet."""
    facing = np.clip(np.sum(to_lamp * to_camera, axis=-1), -1.0, 1.0)
    para, perp = reflectances(np.arccos(facing) / 2, _INDEX)
    return np.asarray((perp - para) / (perp + para))


def _alignment(perpendicular: FloatArray, across: FloatArray, to: FloatArray) -> FloatArray:
    """Cosine of twice the angle, (N,), between two directions (N, 3) seen along a third."""
    sideways = across - np.sum(to * across, axis=-1, keepdims=True) * to
    length = np.linalg.norm(perpendicular, axis=-1) * np.linalg.norm(sideways, axis=-1)
    product = np.sum(perpendicular * sideways, axis=-1)
    cosine = np.divide(product, length, out=np.ones(length.size), where=length > 1e-9)
    return np.asarray(2 * cosine**2 - 1)
