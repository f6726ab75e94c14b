"""Table of a model over theta_i and the half-vector's angles, for materials of renderers.

Nodes: theta_i in steps of 2 degrees, the half-vector's azimuth from the source's, and its polar
angle in steps of its square root, close where a mirror's lobe is. Entries are BRDF times
cos(theta_r), which falls to 0 at the horizon without a jump.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.exchange.exported import Export, ExportedModel, refuse
from analysis.exchange.resampling import beyond_measured, model_valid, near_and_off_mirror
from instrument.geometry import BoolArray, FloatArray, Geometry

N = 129  # nodes of either angle of the half-vector; odd: symmetric about the source's azimuth
THETA_I_DEG = np.linspace(0, 88, 45)
_LARGEST_DEVIATION = 0.1  # of 95 % of the directions


@dataclass(frozen=True, slots=True)
class HalfVectorTable:
    """Table of BRDF times cos(theta_r), in 1/sr.

    values: (45, N, N) over theta_i, azimuth from -180 to 180 degrees, square root of the polar
    angle from 0 to 90 degrees. facts: for the side file.
    """

    values: FloatArray
    facts: Mapping[str, object]

    def density(self) -> FloatArray:
        """Density of reflected light (45, N, N) over the two last axes, relative, nowhere 0."""
        light = self.values * _stretch()
        return np.asarray(np.maximum(light, 1e-6 * np.max(light)))

    def reflectance(self) -> float:
        """Ratio of reflected light to light that comes evenly from the whole hemisphere."""
        step = 1 / (N - 1)
        of_angle = 8 * np.pi**2 * np.sum(self.values[:, :-1] * _stretch()[:, :-1], axis=(1, 2))
        theta_i = np.radians(THETA_I_DEG)
        weight = np.sin(2 * theta_i)
        return float(np.sum(of_angle * weight) / np.sum(weight)) * step**2


def half_vector_table(export: Export, model: ExportedModel, name: str) -> HalfVectorTable:
    """Return the table of the model; `name`: that of the format.

    Values where the model is not valid are those of its formula, negative ones 0: both are counted
    in the facts. Raises `InputError` for a lobe that is too narrow for the nodes.
    """
    geometry, reflected = _nodes()
    value = model.brdf(geometry)
    half = np.zeros(reflected.shape)
    half[reflected] = np.maximum(np.nan_to_num(value, posinf=0.0), 0.0) * np.cos(geometry.theta_r)
    whole = np.concatenate([half[:, :0:-1], half], axis=1)
    nodes = {
        "all": int(np.sum(reflected)),
        "model_not_valid": int(np.sum(~model_valid(model, geometry))),
        "negative": int(np.sum(value < 0)),
        "beyond_measured_angles": int(np.sum(beyond_measured(export.table, geometry))),
    }
    deviation = _deviation(model, whole, name)
    return HalfVectorTable(whole, {"nodes": nodes, "relative_deviation_of_the_table": deviation})


def _nodes() -> tuple[Geometry, BoolArray]:
    """Geometry (N,) of the nodes with a reflection, in degrees, and their mask.

    Half of the azimuths, from the source's: the others mirror them.
    """
    u = np.linspace(0, 1, N)
    theta_i, azimuth, polar = np.meshgrid(
        np.radians(THETA_I_DEG), np.pi * (2 * u[N // 2 :] - 1), u**2 * np.pi / 2, indexing="ij"
    )
    half = _vector(polar, azimuth)
    to_lamp = _vector(theta_i, np.zeros_like(theta_i))
    cosine = np.sum(half * to_lamp, axis=-1)
    to_camera = 2 * cosine[..., None] * half - to_lamp
    reflected = (cosine > 0) & (to_camera[..., 2] > 1e-9)
    return Geometry.from_directions(to_lamp[reflected], to_camera[reflected]), reflected


def _vector(theta: FloatArray, phi: FloatArray) -> FloatArray:
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def _deviation(model: ExportedModel, table: FloatArray, name: str) -> dict[str, float]:
    """Relative deviation of the interpolated table from the model.

    Raises `InputError` if it is large in more than a few directions: a lobe too narrow.
    """
    from scipy.interpolate import RegularGridInterpolator

    geometry = near_and_off_mirror()
    to_lamp = _vector(geometry.theta_i, np.zeros(geometry.shape))
    to_camera = _vector(geometry.theta_r, np.radians(geometry.dphi_deg))
    half = to_lamp + to_camera
    polar = np.arctan2(np.hypot(half[:, 0], half[:, 1]), half[:, 2])
    azimuth = np.mod(np.arctan2(half[:, 1], half[:, 0]) / (2 * np.pi) + 0.5, 1)
    at = np.stack([geometry.theta_i_deg, azimuth, np.sqrt(polar * 2 / np.pi)], axis=-1)
    u = np.linspace(0, 1, N)
    read = RegularGridInterpolator((THETA_I_DEG, u, u), table)(at) / np.cos(geometry.theta_r)
    true = model.brdf(geometry)
    off = np.abs(read - true) / np.maximum(np.abs(true), 1e-12)
    found = {"median": float(np.median(off)), "of_95_percent": float(np.quantile(off, 0.95))}
    if found["of_95_percent"] > _LARGEST_DEVIATION:
        refuse(
            name,
            f"is a table with {N} half-vector angles, which the lobe of this {model.name} is too "
            f"narrow for: they differ by up to {found['of_95_percent']:.0%}",
            "enter the parameters of the model into the renderer by hand, or export csv",
        )
    return found


def _stretch() -> FloatArray:
    """Solid angle of reflected light per step of the two last axes, (45, N, N), relative."""
    u = np.linspace(0, 1, N)
    theta_m, phi_m = u**2 * np.pi / 2, np.pi * (2 * u - 1)
    half = _vector(*np.broadcast_arrays(theta_m[None], phi_m[:, None]))
    theta_i = np.radians(THETA_I_DEG)
    cosine = np.einsum("yxc,ic->iyx", half, _vector(theta_i, np.zeros_like(theta_i)))
    return np.asarray(u * np.sin(theta_m) * np.maximum(cosine, 0))
