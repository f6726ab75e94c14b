"""Spike and lobe of one surface: their strengths follow from its height and correlation length.

What to use when: a smooth or slightly rough surface, with heights of up to 1.5 wavelengths, that
shows both; `unified` leaves the two strengths free, `beckmann_spizzichino` has the lobe alone.

The lobe is that of Beckmann and Spizzichino (1991, (77) over (80)); the spike holds what the lobe
leaves, e^-g of the light (19). By (20) and (73) it is as wide as the diffraction of the area that a
pixel images, far narrower than any lens or lamp; here it is a Gaussian as wide as these make it,
as (61) allows. Lengths are in wavelengths.

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, "Surface Reflection: Physical and Geometrical
Perspectives", IEEE Transactions on Pattern Analysis and Machine Intelligence 13 (1991).
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Validity
from analysis.models.specular.beckmann_spizzichino import (
    CORRELATION_LENGTH,
    SCALE,
    SIGMA_H,
    lobe_brdf,
    lobe_gradient,
    lobe_validity,
    optical_roughness,
)
from analysis.models.specular.unified import SPIKE_WIDTH_DEG, mirror_angle, spike_shape
from instrument.geometry import FloatArray, Geometry


def spike_and_lobe_brdf(
    geometry: Geometry,
    scale: float,
    sigma_h: float,
    correlation_length: float,
    spike_width_deg: float,
) -> FloatArray:
    """BRDF of lobe and spike, scale (f_lobe + e^-g exp(-delta^2/2w^2)/(2 pi w^2 sqrt(cos cos))).

    Arguments and result as in `Model.brdf`. `scale` is the reflectance of the mirror that the
    surface would be if it were smooth: spike and lobe share it as e^-g and 1 - e^-g. Never
    negative; reciprocal. Diverges at grazing, as printed.
    """
    lobe = lobe_brdf(geometry, scale, sigma_h, correlation_length)
    return np.asarray(lobe + scale * _spike(geometry, sigma_h, spike_width_deg))


def spike_and_lobe_gradient(
    geometry: Geometry,
    scale: float,
    sigma_h: float,
    correlation_length: float,
    spike_width_deg: float,
) -> dict[str, FloatArray]:
    """Derivatives of `spike_and_lobe_brdf` by its parameters. As in `Model.gradient`."""
    by = lobe_gradient(geometry, scale, sigma_h, correlation_length)
    spike = _spike(geometry, sigma_h, spike_width_deg)
    w = math.radians(spike_width_deg)
    per_g = -2 * optical_roughness(geometry, sigma_h) / max(sigma_h, 1e-150)
    by_width = (np.square(mirror_angle(geometry) / w) - 2) / w * math.radians(1.0)
    return {
        "scale": by["scale"] + spike,
        "sigma_h": by["sigma_h"] + scale * spike * per_g,
        "correlation_length": by["correlation_length"],
        "spike_width_deg": scale * spike * by_width,
    }


def _spike(geometry: Geometry, sigma_h: float, spike_width_deg: float) -> FloatArray:
    """e^-g times the Gaussian over sqrt(cos cos), in 1/sr."""
    cc = np.cos(geometry.theta_i) * np.cos(geometry.theta_r)
    with np.errstate(under="ignore"):
        share = np.exp(-optical_roughness(geometry, sigma_h))
        return np.asarray(share * spike_shape(geometry, spike_width_deg) / np.sqrt(cc))


def spike_and_lobe_validity(
    geometry: Geometry,
    scale: float,
    sigma_h: float,
    correlation_length: float,
    spike_width_deg: float,
) -> Validity:
    """Validity of the lobe: no shadowing, smooth on a wavelength's scale. As in `Model.brdf`."""
    del spike_width_deg
    return lobe_validity(geometry, scale, sigma_h, correlation_length)


SPIKE_AND_LOBE = Model(
    "spike_and_lobe",
    (SCALE, SIGMA_H, CORRELATION_LENGTH, SPIKE_WIDTH_DEG),
    spike_and_lobe_brdf,
    spike_and_lobe_gradient,
    spike_and_lobe_validity,
)
