"""Facets that reflect by Wolff's model, integrated over Oren and Nayar's rough surface.

What to use when: to judge `wolff_oren_nayar`, whose equation (9) is an approximation to this
integral: the paper (section 4) names it and leaves it to others. Library only: it takes a few
milliseconds a geometry.

Source: L. B. Wolff, S. K. Nayar, M. Oren, "Improved Diffuse Reflection Models for Computer
Vision", International Journal of Computer Vision 30 (1998), section 4; the surface is that of
M. Oren, S. K. Nayar, International Journal of Computer Vision 14 (1995), (16), (31) and (32).
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.rough.v_cavity import Directions, attenuation
from analysis.models.smooth.fresnel import transmittance_at_cosine
from analysis.models.specular.torrance_sparrow import slope_density
from instrument.geometry import FloatArray, Geometry

_SLOPES, _AZIMUTHS = 48, 144
_GRAZING = 1e-9  # cosine of a facet that is turned away: its attenuation is 0
_BLOCK = 64  # geometries at a time


def wolff_facets_brdf(geometry: Geometry, albedo: float, sigma_deg: float, n: float) -> FloatArray:
    """BRDF of V-cavities with facets of (7): direct light alone. As in `Model.brdf`.

    Each facet has the BRDF (albedo/pi) (1 - F) (1 - F) of its own angles, with a constant varrho as
    in (9). `sigma_deg` above 0. Reciprocal. At n = 1 it is the direct part of `oren_nayar_exact`,
    to which it was compared: within 3e-4 up to 80 degrees.
    """
    flat = np.empty(math.prod(geometry.shape))
    nodes = _facets(math.radians(sigma_deg))
    for part, few in geometry.blocks(_BLOCK):
        flat[part] = _mean(few, nodes, n)
    return (albedo / np.pi) * flat.reshape(geometry.shape)


def _facets(sigma: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Slopes and azimuths (M,) in radians, and the share of the surface of each."""
    x, w = np.polynomial.legendre.leggauss(_SLOPES)
    end = min(math.pi / 2, 6 * sigma)
    theta = end * (x + 1) / 2
    weight = w * slope_density(theta, sigma) * np.sin(theta)
    phi = 2 * np.pi * (np.arange(_AZIMUTHS) + 0.5) / _AZIMUTHS
    slopes, azimuths = np.meshgrid(theta, phi, indexing="ij")
    share = np.repeat(weight / weight.sum() / _AZIMUTHS, _AZIMUTHS)
    return slopes.ravel(), azimuths.ravel(), share


def _mean(
    geometry: Geometry, nodes: tuple[FloatArray, FloatArray, FloatArray], n: float
) -> FloatArray:
    """Mean (N,) over the facets, of pi/albedo times the BRDF."""
    theta_a, phi_a, share = nodes
    theta_i, theta_r = geometry.theta_i[:, None], geometry.theta_r[:, None]
    phi_r = np.radians(geometry.dphi_deg)[:, None]
    towards = Directions(theta_i, np.zeros_like(theta_i), theta_r, phi_r)
    lamp = np.cos(theta_i) * np.cos(theta_a) + np.sin(theta_i) * np.sin(theta_a) * np.cos(phi_a)
    camera = np.cos(theta_r) * np.cos(theta_a) + np.sin(theta_r) * np.sin(theta_a) * np.cos(
        phi_r - phi_a
    )
    lamp, camera = np.maximum(lamp, _GRAZING), np.maximum(camera, _GRAZING)
    through = transmittance_at_cosine(lamp, n) * transmittance_at_cosine(camera, n)
    area = lamp * camera * attenuation(towards, theta_a, phi_a)
    scale = np.cos(theta_a) * np.cos(theta_i) * np.cos(theta_r)
    return np.asarray((through * area / scale) @ share)
