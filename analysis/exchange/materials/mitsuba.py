"""Mitsuba 3: a material in XML, its plug-in `diffuse` where that is the model, else `measured`.

`diffuse` is Lambert's law. No other plug-in has a formula of this program: `roughconductor` has
GGX and Beckmann facets with another Fresnel term and another shadowing, and none is rough and matt.
`measured` reads a table of BRDF times cos(theta_r), in a binary tensor file: one file for variants
with RGB colours, one for spectral variants.

Layout of the table: over theta_i, u(phi_m), u(theta_m), where m is the half-vector,
u(theta) = sqrt(2 theta/pi) and u(phi) = (phi_m - phi_i)/2pi + 1/2; interpolated linearly. With
`jacobian` = 0 and a uniform `vndf`, entries are plain values. Source: J. Dupuy, W. Jakob, "An
Adaptive Parameterization for Efficient Material Acquisition and Rendering", ACM Transactions on
Graphics 37 (2018), and the documentation and source of Mitsuba's plug-in `measured`.

Azimuth: phi_m - phi_i = 0 where the half-vector leans towards the source.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.exchange.exported import Export, ExportedModel, fact_lines, refuse
from analysis.exchange.resampling import (
    beyond_measured,
    model_comment,
    model_valid,
    near_and_off_mirror,
    require_resampling,
    side_file,
)
from instrument.geometry import BoolArray, FloatArray, Geometry

NAME = "mitsuba"
_N = 129  # nodes of either angle of the half-vector; odd: symmetric about the source's azimuth
_THETA_I_DEG = np.linspace(0, 88, 45)
_TYPES = {"uint8": 1, "float32": 10}  # numbers of tensor files
_VISIBLE_NM = (360.0, 830.0)  # limits of Mitsuba's spectra: the same value over all
_LARGEST_DEVIATION = 0.1  # of 95 % of the directions
_NOTE = (
    "Every value of the .bsdf files is modelled: the run was resampled through the fitted model. "
    "Values where the model is not valid are those of its formula, negative ones 0."
)


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield the material; for all but Lambert's law also its tables and their side file."""
    model = require_resampling(export, NAME)
    comment = "\n".join([*model_comment(model), *fact_lines(export)])
    if model.name == "lambert":
        albedo = f'<spectrum name="reflectance" value="{model.values["albedo"]!r}"/>'
        yield f"{stem}.xml", _material("diffuse", albedo, comment)
        return
    geometry, reflected = _nodes()
    value = np.maximum(np.nan_to_num(model.brdf(geometry), posinf=0.0), 0.0)
    table = np.zeros(reflected.shape)
    table[reflected] = value * np.cos(geometry.theta_r)
    whole = np.concatenate([table[:, :0:-1], table], axis=1)
    more = {
        "nodes": {
            "all": int(np.sum(reflected)),
            "model_not_valid": int(np.sum(~model_valid(model, geometry))),
            "beyond_measured_angles": int(np.sum(beyond_measured(export.table, geometry))),
        },
        "relative_deviation_of_the_table": _deviation(model, whole),
    }
    source = '<string name="filename" value="$table"/>'
    usage = (
        f"{comment}\nload_file('{stem}.xml', table='{stem}_rgb.bsdf'), in spectral variants "
        f"table='{stem}_spectral.bsdf'"
    )
    yield f"{stem}.xml", _material("measured", source, usage)
    yield f"{stem}_rgb.bsdf", _tensors(_fields(whole, {"rgb": _repeated(whole, 3)}))
    spectral = {"wavelengths": np.array(_VISIBLE_NM, "f4"), "spectra": _repeated(whole, 2)}
    yield f"{stem}_spectral.bsdf", _tensors(_fields(whole, spectral))
    yield side_file(export, model, stem, _NOTE, more)


def _material(plug_in: str, content: str, comment: str) -> bytes:
    allowed = re.sub("-(?=-)", "- ", comment)  # XML has no double hyphen in a comment
    return (
        f'<?xml version="1.0" encoding="utf-8"?>\n<!--\n{allowed}\n-->\n'
        f'<bsdf version="3.0.0" type="{plug_in}">\n    {content}\n</bsdf>\n'
    ).encode()


def _nodes() -> tuple[Geometry, BoolArray]:
    """Geometry (N,) of the nodes with a reflection, in degrees, and their mask.

    Half of the azimuths, from the source's: the others mirror them.
    """
    u = np.linspace(0, 1, _N)
    theta_i, azimuth, polar = np.meshgrid(
        np.radians(_THETA_I_DEG), np.pi * (2 * u[_N // 2 :] - 1), u**2 * np.pi / 2, indexing="ij"
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


def _deviation(model: ExportedModel, table: FloatArray) -> dict[str, float]:
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
    u = np.linspace(0, 1, _N)
    read = RegularGridInterpolator((_THETA_I_DEG, u, u), table)(at) / np.cos(geometry.theta_r)
    true = model.brdf(geometry)
    off = np.abs(read - true) / np.maximum(np.abs(true), 1e-12)
    found = {"median": float(np.median(off)), "of_95_percent": float(np.quantile(off, 0.95))}
    if found["of_95_percent"] > _LARGEST_DEVIATION:
        refuse(
            NAME,
            f"is a table with {_N} half-vector angles, which the lobe of this {model.name} is too "
            f"narrow for: they differ by up to {found['of_95_percent']:.0%}",
            "enter the parameters of the model into the renderer by hand, or export csv",
        )
    return found


def _repeated(table: FloatArray, times: int) -> NDArray[np.float32]:
    return np.repeat(table[None, :, None], times, axis=2).astype("f4")


def _fields(table: FloatArray, colours: Mapping[str, NDArray[Any]]) -> Mapping[str, NDArray[Any]]:
    """All fields of a tensor file; `luminance` serves importance sampling alone."""
    uniform = np.ones((1, _THETA_I_DEG.size, 2, 2), "f4")
    return {
        "description": np.frombuffer(b"modelled by gonio", "u1"),
        "jacobian": np.zeros(1, "u1"),
        "phi_i": np.zeros(1, "f4"),
        "theta_i": np.radians(_THETA_I_DEG).astype("f4"),
        "ndf": np.ones((2, 2), "f4"),
        "sigma": np.ones((2, 2), "f4"),
        "vndf": uniform,
        "luminance": _density(table)[None].astype("f4"),
        **colours,
    }


def _density(table: FloatArray) -> FloatArray:
    """Density of reflected light over the two coordinates, nowhere 0."""
    u = np.linspace(0, 1, _N)
    theta_m, phi_m = u**2 * np.pi / 2, np.pi * (2 * u - 1)
    half = _vector(*np.broadcast_arrays(theta_m[None], phi_m[:, None]))
    theta_i = np.radians(_THETA_I_DEG)
    cosine = np.einsum("yxc,ic->iyx", half, _vector(theta_i, np.zeros_like(theta_i)))
    stretch = u * np.sin(theta_m)
    return np.asarray(np.maximum(table * stretch * np.maximum(cosine, 0), 1e-6 * np.max(table)))


def _tensors(fields: Mapping[str, NDArray[Any]]) -> bytes:
    """Tensor file, version 1.0, little-endian: a list of fields and then their values."""
    listed = sum(2 + len(name) + 2 + 1 + 8 + 8 * a.ndim for name, a in fields.items())
    offset = 12 + 2 + 4 + listed
    head, body = [b"tensor_file\0\x01\x00", struct.pack("<I", len(fields))], []
    for name, array in fields.items():
        head += [
            struct.pack("<H", len(name)), name.encode(),
            struct.pack("<HBQ", array.ndim, _TYPES[array.dtype.name], offset),
            struct.pack(f"<{array.ndim}Q", *array.shape),
        ]  # fmt: skip
        body.append(array.astype(array.dtype.newbyteorder("<")).tobytes())
        offset += len(body[-1])
    return b"".join(head + body)
