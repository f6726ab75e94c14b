"""Resampling of a run through its fitted model, for formats that need values at all angles."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from analysis.exchange.exported import BrdfTable, Export, ExportedModel, one_line, refuse
from analysis.models import MODELS
from instrument.geometry import BoolArray, FloatArray, Geometry

# Difference of two values at mirrored azimuths, in units of its own u, beyond which the sample is
# anisotropic: noise exceeds it once in a million pairs.
_ANISOTROPIC_U = 5.0
_SAME_DECIMALS = 3  # degrees equal to this many decimals are one angle


def require_resampling(export: Export, name: str) -> ExportedModel:
    """Return the model through which the values may be resampled; `name`: that of the format.

    Raises `InputError` for relative or anisotropic values, for a run without a model, and for a
    model that is not valid at the measured angles.
    """
    export.require_absolute(name)
    model = export.require_model(name)
    table = export.table
    valid = model_valid(model, table.geometry)
    if not np.all(valid):
        bad = int(np.argmin(valid))
        refuse(
            name,
            f"is filled by the model {model.name}, which is not valid at {np.sum(~valid)} of "
            f"{table.size} measured points, the first at {_angles(table.geometry, bad)}",
            "fit a model that is valid there (gonio models names them), or export measured values",
        )
    pair = _anisotropic_pair(table)
    if pair is not None:
        first, second = (f"{table.brdf[k]:.4g} 1/sr at {_angles(table.geometry, k)}" for k in pair)
        refuse(
            name,
            f"holds isotropic BRDF, and these values are not: {first}, but {second}",
            "export measured values, as csv or nexus",
        )
    return model


def model_valid(model: ExportedModel, geometry: Geometry) -> BoolArray:
    """Mask of the geometry's shape: True where the model's formula is valid."""
    return MODELS[model.name].validity(geometry, **model.values).mask


def side_file(
    export: Export, model: ExportedModel, stem: str, note: str, more: Mapping[str, object]
) -> tuple[str, bytes]:
    """Name and content of the side file, JSON: the origin of values that were not measured.

    stem: its name without .json. note: the file's statement in words. more: further entries.
    """
    table, units = export.table, _units(model)
    parameters = {
        name: {"value": value, "u": model.u.get(name), "unit": units.get(name, "")}
        for name, value in model.values.items()
    }
    content = {
        "note": note,
        "origin": "modelled",
        "model": model.name,
        "verdict": model.verdict,
        "parameters": parameters,
        "measured": {
            "points": table.size,
            "largest_theta_i_deg": float(np.max(table.geometry.theta_i_deg)),
            "largest_theta_r_deg": float(np.max(table.geometry.theta_r_deg)),
            "source_sr": table.source_sr,
            "receiver_sr": table.receiver_sr,
        },
        **more,
        "facts": {name: one_line(text) for name, text in export.facts.items()},
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    return f"{stem}.json", f"{text}\n".encode()


def model_comment(model: ExportedModel) -> list[str]:
    """Lines that name the model, its parameters with u, and the verdict on it."""
    units = _units(model)
    lines = [f"modelled, not measured: {model.name}, fitted by gonio; verdict: {model.verdict}"]
    for name, value in model.values.items():
        u, unit = model.u.get(name), units.get(name, "").removesuffix("1")
        known = "u not determined" if u is None else f"u = {u:.2g}"
        lines.append(f"{name} = {value:.6g} {unit}".rstrip() + f" ({known})")
    return lines


def _units(model: ExportedModel) -> dict[str, str]:
    return {parameter.name: parameter.unit for parameter in MODELS[model.name].parameters}


def beyond_measured(table: BrdfTable, geometry: Geometry) -> BoolArray:
    """Mask of the geometry's shape: angles beyond the largest measured one, in degrees."""
    return np.asarray(
        (geometry.theta_i_deg > np.max(table.geometry.theta_i_deg))
        | (geometry.theta_r_deg > np.max(table.geometry.theta_r_deg))
    )


def near_and_off_mirror() -> Geometry:
    """Geometry (2000,) in degrees to compare a table with its model: half of it near a mirror's.

    Nearness from 0.01 to 10 degrees, each order of magnitude as often.
    """
    rng = np.random.default_rng(20)
    theta_i, theta_r = rng.uniform(0, 70, (2, 1000))
    dphi = rng.uniform(0, 360, 1000)
    off, turned = 10 ** rng.uniform(-2, 1, (2, 1000)) * rng.choice([-1, 1], (2, 1000))
    near = np.abs(np.clip(theta_i + off, -70, 70))
    return Geometry.from_degrees(
        theta_i=np.concatenate([theta_i, theta_i]),
        theta_r=np.concatenate([theta_r, near]),
        dphi=np.concatenate([dphi, 180 + turned]),
    )


def _anisotropic_pair(table: BrdfTable) -> tuple[int, int] | None:
    """Two points at mirrored azimuths that differ by more than their u allows."""
    g = table.geometry
    azimuth = np.mod(g.dphi_deg, 360)
    keys = np.round(
        np.stack([g.theta_i_deg, g.theta_r_deg, np.minimum(azimuth, 360 - azimuth)], axis=1),
        _SAME_DECIMALS,
    )
    _, member = np.unique(keys, axis=0, return_inverse=True)
    side, order = azimuth > 180, np.argsort(member.reshape(-1), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(member.reshape(-1)))[:-1])
    for group in groups:
        for first in group[~side[group]]:
            for second in group[side[group]]:
                if _differ(table.brdf, table.u_brdf, first, second):
                    return int(first), int(second)
    return None


def _differ(brdf: FloatArray, u: FloatArray, first: int, second: int) -> bool:
    allowed = _ANISOTROPIC_U * np.hypot(u[first], u[second])
    return bool(abs(brdf[first] - brdf[second]) > allowed)  # False where no u is known


def _angles(geometry: Geometry, point: int) -> str:
    return (
        f"theta_i {geometry.theta_i_deg[point]:g}, theta_r {geometry.theta_r_deg[point]:g}, "
        f"dphi {geometry.dphi_deg[point]:g} degrees"
    )
