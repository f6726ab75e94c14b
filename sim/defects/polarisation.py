"""Polarisation: a lamp whose light is partly polarised, a camera that prefers one direction.

Both are given as the relative excess of the light that vibrates horizontally, across the plane of
the normal and of the lamp, or of the camera. Facets of the surface reflect after Fresnel (Nayar,
Ikeuchi and Kanade 1991, equations (12), (13), (41)-(43)); light of the body is depolarised inside,
and passes the surface twice after Fresnel. In the plane of incidence that is exact for facets;
outside it the small product of both is approximate. A white tile depolarises all of it.
"""

from __future__ import annotations

import numpy as np

from analysis.models import MODELS
from analysis.models.base import Model, named_terms
from analysis.models.smooth.fresnel import reflectances
from instrument.config.simulated.sample import SimulatedSample
from instrument.geometry import Brdf, FloatArray, Geometry
from sim.defects.mechanics import SeenAngles

INDEX = 1.5  # of glass, paint and plastics
FACETS = (
    "torrance_sparrow",
    "torrance_sparrow_lobe",
    "fresnel_lobe",
    "beckmann_spizzichino",
    "ggx",
    "ggx_f90",
)
"""Terms of a model that facets of its surface reflect; all others count as its body."""


def polarised(
    brdf: Brdf, sample: SimulatedSample, angles: SeenAngles, *, lamp: float, camera: float
) -> Brdf:
    """Return the BRDF of a sample as this lamp and this camera see it.

    `lamp`, `camera`: relative excess of horizontal light, -1 to 1. `angles`: of their axes. The
    result takes geometries of any shape and returns 1/sr.
    """
    if not lamp and not camera:
        return brdf
    facets = [term for term in named_terms(MODELS[sample.model]) if term.name in FACETS]

    def seen(geometry: Geometry) -> FloatArray:
        mirrored = sum((_term(term, sample, geometry) for term in facets), np.zeros(()))
        body = np.asarray(brdf(geometry)) - mirrored
        through = body_factor(geometry, lamp, camera)
        return body * through + mirrored * facet_factor(geometry, angles, lamp, camera)

    return seen


def _term(term: Model, sample: SimulatedSample, geometry: Geometry) -> FloatArray:
    return term.brdf(geometry, **{p.name: sample.parameters[p.name] for p in term.parameters})


def body_factor(geometry: Geometry, lamp: float, camera: float) -> FloatArray:
    """Return the factor of light from inside the sample, of the geometry's shape, without unit.

    `lamp`, `camera`: relative excess of horizontal light.
    """
    into, out = (_transmitted_excess(a) for a in (geometry.theta_i, geometry.theta_r))
    factor: FloatArray = (1 + lamp * into) * (1 + camera * out)
    return factor


def facet_factor(geometry: Geometry, angles: SeenAngles, lamp: float, camera: float) -> FloatArray:
    """Return the factor of light reflected by facets, of the geometry's shape, without unit.

    `lamp`, `camera`: relative excess of horizontal light. `angles` of their axes say which
    direction is horizontal; the geometry may be that of any part of lamp and lens.
    """
    to_lamp, to_camera, across_lamp, across_camera = _directions(geometry, angles)
    facing = np.clip(np.sum(to_lamp * to_camera, axis=-1), -1.0, 1.0)
    perpendicular = np.cross(to_lamp, to_camera)
    with_lamp = _alignment(perpendicular, across_lamp, to_lamp)
    with_camera = _alignment(perpendicular, across_camera, to_camera)
    para, perp = reflectances(np.arccos(facing) / 2, INDEX)
    excess = (perp - para) / (perp + para)
    single = excess * (lamp * with_lamp + camera * with_camera)
    factor: FloatArray = 1 + single + lamp * camera * with_lamp * with_camera
    return factor


def _transmitted_excess(theta: FloatArray) -> FloatArray:
    """Relative excess of horizontal light that passes the surface at `theta` in radians."""
    para, perp = reflectances(theta, INDEX)
    passed = 2 - para - perp
    return np.divide(para - perp, passed, out=np.zeros(passed.shape), where=passed > 0)


def _directions(
    geometry: Geometry, angles: SeenAngles
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Unit vectors to lamp and camera (..., 3), and the horizontal directions (3,) of their axes.

    In axes about the normal, with the first towards whichever is further from the normal: near it
    the azimuth of a part of lamp or lens says nothing about that of its axis.
    """
    between = np.radians(angles.dphi + (180.0 if angles.theta_r < 0 else 0.0))
    lamp_leads = angles.theta_i > abs(angles.theta_r)
    own, other = np.array([0.0, 1.0, 0.0]), np.array([-np.sin(between), np.cos(between), 0.0])
    azimuth = np.radians(geometry.dphi_deg)
    zero = np.zeros_like(azimuth)
    if lamp_leads:
        lamp, camera = _unit(geometry.theta_i, zero), _unit(geometry.theta_r, azimuth)
        return lamp, camera, own, other
    lamp, camera = _unit(geometry.theta_i, azimuth), _unit(geometry.theta_r, zero)
    return lamp, camera, other, own


def _unit(theta: FloatArray, azimuth: FloatArray) -> FloatArray:
    s = np.sin(theta)
    return np.stack(
        np.broadcast_arrays(s * np.cos(azimuth), s * np.sin(azimuth), np.cos(theta)), axis=-1
    )


def _alignment(perpendicular: FloatArray, across: FloatArray, to: FloatArray) -> FloatArray:
    """Cosine of twice the angle from a horizontal direction to the perpendicular of the facets."""
    sideways = across - (to @ across)[..., np.newaxis] * to
    product = np.sum(perpendicular * sideways, axis=-1) ** 2
    length = np.sum(perpendicular**2, axis=-1) * np.sum(sideways**2, axis=-1)
    known = length > 1e-18
    share = np.divide(product, length, out=np.full(length.shape, 0.5), where=known)
    alignment: FloatArray = 2 * share - 1
    return alignment
