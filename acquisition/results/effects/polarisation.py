"""Effect of polarised light, or of a camera that prefers one polarisation.

Light that comes out of the sample's inside has passed its surface twice, and light of the mirror
side is reflected by facets; both prefer one polarisation, by Fresnel's formulas for an index of
1.5, which is near that of most dielectrics. The tile is a perfect depolariser. Which part of a
value the facets reflect is estimated from the values themselves, by quick fits of a rough matt
surface with a lobe. Values without a tile have an unknown unit at each setting of the lamp, and are
fitted as such.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acquisition.results.effects.effect import Effect, Readings
from analysis.data.measurements import Measurements
from analysis.fit.first_fit import FirstFits
from analysis.fit.fit import refine
from analysis.fit.relative_scale import FACTOR_NAME
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from analysis.models.smooth.fresnel import reflectances
from instrument.errors import NotDetermined
from instrument.geometry import FloatArray, camera_direction, lamp_direction

LAMP, CAMERA = "polarisation of the lamp", "polarisation of the camera"
_INDEX = 1.5
_BODY, _LOBES = "oren_nayar", ("torrance_sparrow_lobe", "ggx")
_U_FIT = 0.01  # relative, of the values in the quick fit


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
    """Share of the values, (N,), that the facets of the surface reflect, by quick fits.

    It lies between 0 and 1, and is 0 where there are too few points to tell.
    """
    theta_i, theta_r, dphi = readings.angles_deg()
    known = np.isfinite(readings.value) & (readings.value > 0)
    value, share = readings.value[known], np.zeros(known.size)
    m = Measurements.bare(theta_i[known], theta_r[known], dphi[known], value, _U_FIT * value)
    if not readings.absolute:
        m = replace(m, relative=True, free_levels=True)
    try:
        problem, x = _quick_fit(m)
    except NotDetermined:
        return share
    fitted = dict(zip((p.name for p in problem.model.parameters), x.tolist(), strict=True))
    lobe = MODELS[problem.model.name.removeprefix(f"{_BODY}+")]
    facets = lobe.brdf(m.geometry, **{p.name: fitted[p.name] for p in lobe.parameters})
    facets *= fitted.get(FACTOR_NAME, 1.0)
    whole = problem.model_brdf(x, m.geometry)
    share[known] = np.clip(facets / np.maximum(whole, 1e-12), 0.0, 1.0)
    return share


def _quick_fit(m: Measurements) -> tuple[Problem, FloatArray]:
    """Return the better fit of a rough matt surface with one of the lobes: its problem, and x (K,).

    Unknown levels of the lamp need the shared errors of a full fit: a lobe would explain them.
    """
    fits = FirstFits(m)
    firsts = [fits.of(MODELS[f"{_BODY}+{lobe}"]) for lobe in _LOBES]
    if m.free_levels:
        full = min((refine(f, m, None, profiles=False) for f in firsts), key=lambda one: one.bic)
        return full.problem, full.x
    best = min(firsts, key=lambda one: one.bic)
    return best.problem, best.solution.x


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
