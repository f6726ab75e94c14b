"""The unified framework: diffuse lobe, specular lobe and specular spike.

What to use when: a surface that shows all three components. `moving_sensor` and `moving_source`,
the paper's own equations, are library only.

Source: S. K. Nayar, K. Ikeuchi, T. Kanade, "Surface Reflection: Physical and Geometrical
Perspectives", IEEE Transactions on Pattern Analysis and Machine Intelligence 13 (1991),
equations (61) and (62). Its double delta of the spike is here a Gaussian of a stated width, as the
paper allows: a lamp and a lens have a size.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.models.base import Model, Parameter, Validity
from analysis.models.specular.torrance_sparrow import (
    ANY_SIGMA_DEG,
    SIGMA_DEG,
    half_vector,
    tangential_squared,
)
from analysis.models.validity import either_grazes, valid_except
from instrument.geometry import FloatArray, Geometry

DIFFUSE = Parameter("diffuse", "1", 0.0, 1.0, 0.5, scale=True)
LOBE = Parameter("lobe", "1/sr", 0.0, 10.0, 0.1, scale=True)
SPIKE = Parameter("spike", "1", 0.0, 10.0, 0.1, scale=True)
SPIKE_WIDTH_DEG = Parameter("spike_width_deg", "degrees", 0.05, 10.0, 1.0, scanned=True)


def unified_brdf(
    geometry: Geometry,
    diffuse: float,
    lobe: float,
    sigma_deg: float,
    spike: float,
    spike_width_deg: float,
) -> FloatArray:
    """The three components as a BRDF: 1991, equation (61) over cosθ_i, made reciprocal.

    diffuse/π + lobe exp(-θ_a²/2σ²)/(cosθ_i cosθ_r) + spike exp(-δ²/2w²)/(2πw² √(cosθ_i cosθ_r)),
    δ the angle from the mirror direction. `diffuse` is an albedo, `spike` the reflectance of the
    remaining mirror, `lobe` the lobe's peak at normal incidence. Never negative. Without
    attenuation it grows as 1/cosθ, as printed (footnote 8). Arguments and result: `Model.brdf`.
    """
    cc = np.cos(geometry.theta_i) * np.cos(geometry.theta_r)
    with np.errstate(under="ignore"):
        lobe_part = lobe * lobe_shape(geometry, sigma_deg) / cc
        spike_part = spike * spike_shape(geometry, spike_width_deg) / np.sqrt(cc)
        return np.asarray(diffuse / math.pi + lobe_part + spike_part)


def unified_gradient(
    geometry: Geometry,
    diffuse: float,
    lobe: float,
    sigma_deg: float,
    spike: float,
    spike_width_deg: float,
) -> dict[str, FloatArray]:
    """Derivatives of `unified_brdf` by its parameters. As in `Model.gradient`."""
    del diffuse  # the BRDF is linear in it
    sigma, w, degree = math.radians(sigma_deg), math.radians(spike_width_deg), math.radians(1.0)
    theta_a = half_vector(geometry)[0]
    delta = mirror_angle(geometry)
    cc = np.cos(geometry.theta_i) * np.cos(geometry.theta_r)
    with np.errstate(under="ignore"):
        by_lobe = lobe_shape(geometry, sigma_deg) / cc
        by_spike = spike_shape(geometry, spike_width_deg) / np.sqrt(cc)
        return {
            "diffuse": np.full(geometry.shape, 1 / math.pi),
            "lobe": by_lobe,
            "sigma_deg": lobe * by_lobe * np.square(theta_a) / sigma**3 * degree,
            "spike": by_spike,
            "spike_width_deg": spike * by_spike * (np.square(delta / w) - 2) / w * degree,
        }


def unified_validity(geometry: Geometry, **_: float) -> Validity:
    """Valid unless lamp or camera grazes: 1/cosθ diverges. Arguments as in `Model.brdf`."""
    reason = "lamp or camera grazes the surface: the printed 1/cosθ, without attenuation, diverges"
    return valid_except(geometry, (either_grazes(geometry), reason))


def moving_sensor(
    geometry: Geometry,
    C_dl: float,
    C_sl: float,
    sigma_deg: float,
    C_ss: float,
    spike_width_deg: float,
) -> FloatArray:
    """Image irradiance under a fixed lamp: 1991, equation (61), in the units of the C.

    C_dl + C_sl / cosθ_r exp(-α²/2σ²) + C_ss δ, with δ in 1/sr. The lobe has its peak beyond the
    mirror direction. Of the geometry's shape.
    """
    with np.errstate(under="ignore"):
        lobe = C_sl / np.cos(geometry.theta_r) * lobe_shape(geometry, sigma_deg)
        return C_dl + lobe + C_ss * spike_shape(geometry, spike_width_deg)


def moving_source(
    geometry: Geometry,
    K_dl: float,
    K_sl: float,
    sigma_deg: float,
    K_ss: float,
    spike_width_deg: float,
) -> FloatArray:
    """Image irradiance in a fixed camera: 1991, equation (62), in the units of the K.

    K_dl cosθ_i + K_sl exp(-α²/2σ²) + K_ss δ, with δ in 1/sr. Lobe and spike are symmetric about
    θ_i = θ_r. Of the geometry's shape.
    """
    with np.errstate(under="ignore"):
        lobe = K_sl * lobe_shape(geometry, sigma_deg)
        spike = K_ss * spike_shape(geometry, spike_width_deg)
        return K_dl * np.cos(geometry.theta_i) + lobe + spike


def lobe_shape(geometry: Geometry, sigma_deg: float) -> FloatArray:
    """exp(-α²/2σ²), 0 to 1, of the geometry's shape: 1991, (56), α the half-vector's θ_a."""
    sigma = math.radians(ANY_SIGMA_DEG.check(sigma_deg))
    return np.exp(-0.5 * np.square(half_vector(geometry)[0] / sigma))


def spike_shape(geometry: Geometry, spike_width_deg: float) -> FloatArray:
    """exp(-δ²/2w²)/(2πw²) in 1/sr, for the δ(θ_i - θ_r)δ(φ_r) of (61) and (62).

    Of the geometry's shape. Over the directions it integrates to 1 - w²/3 (w in radians: 1e-4 less
    at 1 degree).
    """
    w = math.radians(SPIKE_WIDTH_DEG.check(spike_width_deg))
    return np.exp(-0.5 * np.square(mirror_angle(geometry) / w)) / (2 * math.pi * w**2)


def mirror_angle(geometry: Geometry) -> FloatArray:
    """δ in radians, 0 to π: angle from the lamp's mirror direction to the camera.

    Of the geometry's shape. Computed from the chord, so that small angles are exact.
    """
    up = np.cos(geometry.theta_i) - np.cos(geometry.theta_r)
    chord = np.sqrt(tangential_squared(geometry) + up * up)
    return np.asarray(2 * np.arcsin(np.minimum(chord / 2, 1.0)))


def _component(scale: Parameter, *width: Parameter) -> Model:
    """One of the three components, as a model with its own parameters alone."""
    without = {"diffuse": 0.0, "lobe": 0.0, "spike": 0.0}
    widths = {p.name: p.default for p in (SIGMA_DEG, SPIKE_WIDTH_DEG)}

    def kernel(geometry: Geometry, **parameters: float) -> FloatArray:
        return unified_brdf(geometry, **{**without, **widths, **parameters})

    return Model(f"{scale.name} of unified", (scale, *width), kernel)


UNIFIED = Model(
    "unified",
    (DIFFUSE, LOBE, SIGMA_DEG, SPIKE, SPIKE_WIDTH_DEG),
    unified_brdf,
    unified_gradient,
    unified_validity,
    terms=(
        _component(DIFFUSE),
        _component(LOBE, SIGMA_DEG),
        _component(SPIKE, SPIKE_WIDTH_DEG),
    ),
)
