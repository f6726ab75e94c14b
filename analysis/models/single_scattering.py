"""Single scattering below the surface by particles with a directional phase function.

What to use when: beside a diffuse term, for loose or layered matter (fibres, powder, skin, plants)
that scatters back towards the lamp, or forward past the mirror direction, over wide angles.

Sources: H. von Seeliger (1887) and E. Lommel (1889), for the half-space, as in S. Chandrasekhar,
Radiative Transfer (Dover 1960), chapter III; L. G. Henyey, J. L. Greenstein, "Diffuse Radiation in
the Galaxy", Astrophysical Journal 93 (1941), for the phase function; P. Hanrahan, W. Krueger,
"Reflection from Layered Surfaces due to Subsurface Scattering", SIGGRAPH (1993), for the two as a
BRDF.
"""

from __future__ import annotations

import numpy as np

from analysis.models.base import Model, Parameter, Validity, cached_per_geometry
from analysis.models.validity import GRAZING, both_graze, valid_except
from instrument.geometry import FloatArray, Geometry

# A single-scattering albedo up to 1; above, it stands for multiple scattering of like direction.
SCATTERING = Parameter("scattering", "1", 0.0, 10.0, 0.5, scale=True)
ASYMMETRY = Parameter(
    "asymmetry", "1", -0.95, 0.95, 0.0, starts=(-0.85, -0.6, -0.3, 0.0, 0.3, 0.6, 0.85)
)


def single_scattering_brdf(geometry: Geometry, scattering: float, asymmetry: float) -> FloatArray:
    """Lommel and Seeliger's BRDF: scattering p(gamma) / (4 pi (cos_i + cos_r)).

    p = (1 - g^2) / (1 + g^2 + 2 g cos(gamma))^(3/2) is Henyey and Greenstein's phase function of
    gamma, the angle between the directions to lamp and camera (the light turns by pi - gamma), and
    g = `asymmetry`: below 0 backward, 0 isotropic, above 0 forward. The mean of p over the sphere
    is 1. Never negative; reciprocal; half of Lambert's for g = 0 at normal incidence and view. It
    grows without limit only where lamp and camera both graze. Arguments and result as in
    `Model.brdf`.
    """
    cos_sum, base = _denominators(geometry, asymmetry)
    phase = (1 - asymmetry**2) / (base * np.sqrt(base))
    return np.asarray(scattering * phase / (4 * np.pi * cos_sum))


def single_scattering_gradient(
    geometry: Geometry, scattering: float, asymmetry: float
) -> dict[str, FloatArray]:
    """Derivatives of `single_scattering_brdf` by both. As in `Model.gradient`."""
    g = asymmetry
    per_scattering = single_scattering_brdf(geometry, 1.0, g)
    _, base = _denominators(geometry, g)
    growth = -2 * g / (1 - g * g) - 3 * (g + _cos_gamma(geometry)) / base
    return {"scattering": per_scattering, "asymmetry": scattering * per_scattering * growth}


def single_scattering_validity(geometry: Geometry, scattering: float, asymmetry: float) -> Validity:
    """Valid for scattering up to 1, unless both directions graze. Arguments as in `Model.brdf`."""
    del asymmetry  # validity does not depend on it
    return valid_except(
        geometry,
        (both_graze(geometry) & (scattering > 0), GRAZING),
        (scattering > 1, "scattering above 1: particles would scatter more than they receive"),
    )


def _denominators(geometry: Geometry, g: float) -> tuple[FloatArray, FloatArray]:
    """cos_i + cos_r, and 1 + g^2 + 2 g cos(gamma)."""
    cos_sum = np.cos(geometry.theta_i) + np.cos(geometry.theta_r)
    return cos_sum, np.asarray(1 + g * g + 2 * g * _cos_gamma(geometry))


@cached_per_geometry
def _cos_gamma(geometry: Geometry) -> FloatArray:
    """Cosine of the angle between the directions to the lamp and to the camera."""
    across = np.sin(geometry.theta_i) * np.sin(geometry.theta_r) * geometry.cos_dphi
    return np.asarray(np.cos(geometry.theta_i) * np.cos(geometry.theta_r) + across)


SINGLE_SCATTERING = Model(
    "single_scattering",
    (SCATTERING, ASYMMETRY),
    single_scattering_brdf,
    single_scattering_gradient,
    single_scattering_validity,
)
