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

from analysis.exchange.exported import Export, fact_lines
from analysis.exchange.materials.half_vector_table import (
    THETA_I_DEG,
    HalfVectorTable,
    half_vector_table,
)
from analysis.exchange.resampling import model_comment, require_resampling, side_file

Fields = Mapping[str, NDArray[Any]]

NAME = "mitsuba"
_TYPES = {"uint8": 1, "float32": 10}  # numbers of tensor files
_VISIBLE_NM = (360.0, 830.0)  # limits of Mitsuba's spectra: the same value over all
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
    table = half_vector_table(export, model, NAME)
    source = '<string name="filename" value="$table"/>'
    usage = (
        f"{comment}\nload_file('{stem}.xml', table='{stem}_rgb.bsdf'), in spectral variants "
        f"table='{stem}_spectral.bsdf'"
    )
    yield f"{stem}.xml", _material("measured", source, usage)
    yield f"{stem}_rgb.bsdf", _tensors(_fields(table, {"rgb": _repeated(table, 3)}))
    spectral = {"wavelengths": np.array(_VISIBLE_NM, "f4"), "spectra": _repeated(table, 2)}
    yield f"{stem}_spectral.bsdf", _tensors(_fields(table, spectral))
    yield side_file(export, model, f"{stem}.{NAME}", _NOTE, table.facts)


def _material(plug_in: str, content: str, comment: str) -> bytes:
    allowed = re.sub("-(?=-)", "- ", comment)  # XML has no double hyphen in a comment
    return (
        f'<?xml version="1.0" encoding="utf-8"?>\n<!--\n{allowed}\n-->\n'
        f'<bsdf version="3.0.0" type="{plug_in}">\n    {content}\n</bsdf>\n'
    ).encode()


def _repeated(table: HalfVectorTable, times: int) -> NDArray[np.float32]:
    return np.repeat(table.values[None, :, None], times, axis=2).astype("f4")


def _fields(
    table: HalfVectorTable, colours: Mapping[str, NDArray[Any]]
) -> Mapping[str, NDArray[Any]]:
    """All fields of a tensor file; `luminance` serves importance sampling alone."""
    uniform = np.ones((1, THETA_I_DEG.size, 2, 2), "f4")
    return {
        "description": np.frombuffer(b"modelled by gonio", "u1"),
        "jacobian": np.zeros(1, "u1"),
        "phi_i": np.zeros(1, "f4"),
        "theta_i": np.radians(THETA_I_DEG).astype("f4"),
        "ndf": np.ones((2, 2), "f4"),
        "sigma": np.ones((2, 2), "f4"),
        "vndf": uniform,
        "luminance": table.density()[None].astype("f4"),
        **colours,
    }


def _tensors(fields: Fields) -> bytes:
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
