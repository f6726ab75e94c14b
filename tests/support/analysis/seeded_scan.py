"""Seeded scans with known truth and known errors, for the tests of fit and choice."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from analysis.data.acceptance import Acceptance, averaged_brdf
from analysis.data.covariance import Covariance
from analysis.data.measurements import Measurements, SharedError, setting_numbers
from analysis.fit.search.problem import Problem
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry

# Oren and Nayar 1995, section 5: incidence 30, 45 and 60 degrees, .003 sr and .0009 sr, 6 ft.
RIG = Acceptance(
    beam_length_mm=1828.8,
    lamp_distance_mm=1500.0,
    source_solid_angle_sr=0.003,
    receiver_solid_angle_sr=0.0009,
    patch_width_mm=20.0,
    patch_height_mm=20.0,
)
# White plaster, painted sandpaper, white sand; foam, towel, wood shavings (ks: theirs times 4).
DIFFUSE = [(30.0, 0.9), (40.0, 0.8), (35.0, 0.8)]
GLOSSY = [(20.0, 0.8, 0.076), (42.0, 0.75, 0.34), (26.0, 0.70, 0.172)]


def scan_angles() -> tuple[FloatArray, FloatArray, FloatArray]:
    """3 incidences x 33 view angles, less those where the camera would shade the sample."""
    theta_i = np.repeat([30.0, 45.0, 60.0], 33)
    theta_r = np.tile(np.linspace(-80, 80, 33), 3)
    apart = np.abs(theta_i - theta_r) >= 3
    return theta_i[apart], theta_r[apart], np.zeros(int(apart.sum()))


def scan(
    name: str,
    seed: int,
    *,
    u_relative: float = 5e-4,
    u_tile: float = 0.005,
    u_deg: float = 0.02,
    acceptance: Acceptance | None = None,
    **truth: float,
) -> Measurements:
    """Simulated measurements with these uncertainties, of a sample that obeys the model."""
    rng = np.random.default_rng(seed)
    theta_i, theta_r, dphi = scan_angles()
    setting = setting_numbers(theta_i, dphi)
    true_i = theta_i + u_deg * rng.normal(size=3)[setting]
    # A stage repeats its error at every return to an angle.
    view = np.unique(theta_r, return_inverse=True)[1]
    true_r = theta_r + u_deg * rng.normal(size=int(view.max()) + 1)[view]
    true_phi = dphi + u_deg * rng.normal(size=3)[setting]

    def sample(geometry: Geometry) -> FloatArray:
        return MODELS[name].brdf(geometry, **truth)

    if acceptance is None:
        value = sample(Geometry.from_degrees(theta_i=true_i, theta_r=true_r, dphi=true_phi))
    else:
        value = averaged_brdf(sample, true_i, true_r, true_phi, acceptance, 3)
    noisy = value * (1 + u_tile * rng.normal()) * (1 + u_relative * rng.normal(size=value.size))
    return Measurements(
        theta_i_deg=theta_i, theta_r_deg=theta_r, dphi_deg=dphi,
        brdf=noisy, u_random=u_relative * np.abs(value), lamp_setting=setting,
        shared=(SharedError.common_to_all("white tile", u_tile, value.size),),
        u_theta_i_deg=u_deg, u_theta_r_deg=u_deg, u_dphi_deg=u_deg,
    )  # fmt: skip


def noise_free(name: str, truth: dict[str, float]) -> Measurements:
    """Exact values of a model at the angles of the scan, with a stated u of 0.1 %."""
    theta_i, theta_r, dphi = scan_angles()
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r, dphi=dphi)
    value = MODELS[name].brdf(geometry, **truth)
    return Measurements.bare(theta_i, theta_r, dphi, value, 1e-3 * value + 1e-9)


def problem_of(name: str, m: Measurements) -> Problem:
    """Fit of a model to measurements, with their independent uncertainties."""
    assert m.u_random is not None
    C = Covariance(np.square(m.u_random), np.zeros((m.size, 0)))
    return Problem(MODELS[name], m.geometry, m.brdf, C)


def three_sweeps(order: FloatArray | None = None) -> Measurements:
    """Scan of 96 points; `order`: the order in which they were measured."""
    theta_i, theta_r, dphi = scan_angles()
    chosen = np.arange(theta_i.size) if order is None else np.argsort(order)
    return Measurements.bare(theta_i[chosen], theta_r[chosen], dphi[chosen], 0.2, 1e-3)


def noisy_sweeps(
    name: str, theta_i: ArrayLike, theta_r: ArrayLike, seed: int, **truth: float
) -> Measurements:
    """Values of a model in the plane of incidence, each with noise of 0.3 %."""
    geometry = Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r)
    f = MODELS[name].brdf(geometry, **truth)
    noise = np.random.default_rng(seed).normal(size=f.size)
    return Measurements.bare(theta_i, theta_r, 0.0, f * (1 + 0.003 * noise), 0.003 * f)
