"""Radiance: a material file, `plastic` where the model is Lambert's law, else `plasdata`.

`plastic` without a specular part is Lambert's law; its rough gloss is Ward's, which is none of this
program's models. `plasdata` takes BRDF from a data file, interpolated linearly, at coordinates that
a function file computes from the directions. Source: G. Ward and others, "The RADIANCE Synthetic
Imaging System" (reference manual), sections on materials, function files and data files.

Radiance takes BRDF of `plasdata` for light of sources; indirect light is reflected diffusely. The
material's colour is the reflectance of the hemisphere, so that it has the right sum.

Azimuth: that of the half-vector from the source's, 0 to 180 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from analysis.exchange.exported import Export, fact_lines, refuse
from analysis.exchange.materials.half_vector_table import (
    THETA_I_DEG,
    HalfVectorTable,
    N,
    half_vector_table,
)
from analysis.exchange.resampling import model_comment, require_resampling, side_file

NAME = "radiance"
_NOTE = (
    "Every value of the .dat file is modelled: the run was resampled through the fitted model. "
    "Values where the model is not valid are those of its formula, negative ones 0."
)
_PLAIN = re.compile(r"[\w.+-]+")  # names that Radiance takes without quotes

# Names of Radiance: Dx, Dy, Dz: direction of the ray, towards the surface; NxP, NyP, NzP: normal;
# RdotP: cosine between both; Acos, bound, DEGREE: of rayinit.cal. x, y, z: direction to the source.
_FUNCTIONS = """{ Coordinates of a table over theta_i, azimuth and polar angle of the half-vector. }

{ cosines: source to normal, source to half-vector, half-vector to normal }
gonio_s(x,y,z) : bound(0, x*NxP + y*NyP + z*NzP, 1);
gonio_d(x,y,z) : sqrt(bound(1e-9, (1 - x*Dx - y*Dy - z*Dz)/2, 1));
gonio_h(x,y,z) : bound(0, (gonio_s(x,y,z) + RdotP)/(2*gonio_d(x,y,z)), 1);

gonio_theta_i(x,y,z) : Acos(gonio_s(x,y,z))/DEGREE;
gonio_polar(x,y,z) : sqrt(Acos(gonio_h(x,y,z))/(90*DEGREE));

{ product of the sines of source and half-vector; at 0 no azimuth is defined }
gonio_sines(s,h) : sqrt((1 - s*s)*(1 - h*h));
gonio_turn(s,d,h,n) : if(n - 1e-9, Acos(bound(-1, (d - s*h)/n, 1))/DEGREE, 0);
gonio_azimuth(x,y,z) : gonio_turn(gonio_s(x,y,z), gonio_d(x,y,z), gonio_h(x,y,z),
    gonio_sines(gonio_s(x,y,z), gonio_h(x,y,z)));

{ the table holds BRDF times the cosine of the view }
gonio_brdf(v,x,y,z) : if(RdotP - 1e-6, v/RdotP, 0);
"""


def files(export: Export, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield the material; for all but Lambert's law also data, functions and a side file."""
    model = require_resampling(export, NAME)
    if not _PLAIN.fullmatch(stem):
        refuse(NAME, "names its files within the material, without spaces", "choose a plain name")
    lines = [*model_comment(model), *fact_lines(export)]
    if model.name == "lambert":
        albedo = repr(model.values["albedo"])
        numbers = f"5 {albedo} {albedo} {albedo} 0 0"
        yield f"{stem}.rad", _material(lines, stem, "plastic", "0", numbers)
        return
    table = half_vector_table(export, model, NAME)
    coordinates = "gonio_theta_i gonio_azimuth gonio_polar"
    texts = f"6 gonio_brdf {stem}.dat {stem}.cal {coordinates}"
    colour = f"{min(table.reflectance(), 1.0):.6g}"
    found = f"Radiance finds {stem}.dat and {stem}.cal in its working folder or in RAYPATH"
    numbers = f"4 {colour} {colour} {colour} 1"
    yield f"{stem}.rad", _material([*lines, found], stem, "plasdata", texts, numbers)
    yield f"{stem}.dat", _data(table)
    yield f"{stem}.cal", _FUNCTIONS.encode()
    yield side_file(export, model, f"{stem}.{NAME}", _NOTE, table.facts)


def _material(comment: list[str], name: str, kind: str, texts: str, numbers: str) -> bytes:
    told = "".join(f"# {line}\n" for line in comment)
    return f"{told}\nvoid {kind} {name}\n{texts}\n0\n{numbers}\n".encode()


def _data(table: HalfVectorTable) -> bytes:
    """Data file: the borders and the number of nodes of each axis, then the values."""
    half = table.values[:, N // 2 :]
    axes = (
        (THETA_I_DEG[0], THETA_I_DEG[-1], THETA_I_DEG.size),
        (0, 180, half.shape[1]),
        (0, 1, half.shape[2]),
    )
    head = ["3", *(f"{first:g} {last:g} {number}" for first, last, number in axes)]
    rows = [" ".join(f"{v:.6g}" for v in row) for row in np.reshape(half, (-1, N)).tolist()]
    return ("\n".join([*head, *rows]) + "\n").encode()
