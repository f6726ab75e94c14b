"""Planned points of a model with shared errors, and random candidates to choose from."""

from __future__ import annotations

import numpy as np

from analysis.data.measurements import Measurements, SharedError
from analysis.design.information import Information, assumed_problem
from analysis.design.optimal import Candidates, Costs
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry

GLOSSY = MODELS["oren_nayar+torrance_sparrow"]
FOAM = np.array([0.8, 20.0, 0.076])  # sample D of Oren and Nayar 1995: albedo, sigma_deg, ks


def planned(
    theta_i_deg: FloatArray,
    theta_r_deg: FloatArray,
    *,
    u: float = 0.01,
    shared: tuple[SharedError, ...] = (),
    **u_angle: float,
) -> Measurements:
    """Points (N,) in the plane of incidence, with a relative noise and errors that they share."""
    bare = Measurements.bare(theta_i_deg, theta_r_deg, 0.0, np.ones(theta_i_deg.size), u)
    return Measurements(
        theta_i_deg=bare.theta_i_deg,
        theta_r_deg=bare.theta_r_deg,
        dphi_deg=bare.dphi_deg,
        brdf=bare.brdf,
        u_random=bare.u_random,
        lamp_setting=bare.lamp_setting,
        shared=shared,
        **u_angle,
    )


def grid(theta_i_deg: FloatArray, theta_r_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """All pairs of incidences and views, (N,) each, in degrees."""
    theta_i, theta_r = np.meshgrid(theta_i_deg, theta_r_deg, indexing="ij")
    return theta_i.ravel(), theta_r.ravel()


def information(m: Measurements, x: FloatArray = FOAM) -> Information:
    """Information of planned points about the parameters of a glossy rough surface."""
    return Information.of(*assumed_problem(GLOSSY, x, m))


def random_candidates(
    rng: np.random.Generator, count: int, *, equal_costs: bool = False
) -> Candidates:
    """Random geometries at up to three incidences, with random noise, shared errors and times."""
    setting = rng.integers(0, 3, count)
    theta_i = np.array([20.0, 45.0, 65.0])[setting]
    theta_r = rng.uniform(-80, 80, count).round(1)
    tile = SharedError.common_to_all("tile", 0.005, count)
    m = planned(theta_i, theta_r, u=0.003, shared=(tile,), u_theta_i_deg=0.05)
    point_s = np.full(count, 1.0) if equal_costs else rng.uniform(0.5, 3.0, count)
    setting_s = np.zeros(3) if equal_costs else rng.uniform(0.0, 60.0, 3)
    return Candidates(
        geometry=Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r),
        information=information(m),
        costs=Costs(point_s=point_s, setting=setting, setting_s=setting_s, fixed_s=10.0),
    )
