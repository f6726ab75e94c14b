"""Exports drawn at random for the tests of formats: angles, values, facts of strangers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.exchange.exported import BrdfTable, Export
from instrument.geometry import FloatArray, Geometry

KINDS = ("one incidence", "half a sweep", "out of plane", "one point", "whole sweeps")

_PIECES = (
    *(
        "VARS",
        "NUM_POINTS 3",
        "#DIM 9 9",
        "#VS 2",
        "#intheta 77",
        "DataBegin",
        "TIS 5",
        "Monochrome",
    ),
    *('"', "'", ",", "<&>", "\n", "\r\n", "\t", " ", "\x00", "µm ±", "a plate"),
)


def strange_text(rng: np.random.Generator) -> str:
    """Text of up to eight pieces that mean something to one format or another."""
    return " ".join(rng.choice(_PIECES, rng.integers(0, 9)))


def random_export(seed: int) -> Export:
    """Export of one of KINDS, some values negative, u known in most, facts of strangers."""
    rng = np.random.default_rng(seed)
    geometry = _geometry(rng, KINDS[seed % len(KINDS)])
    brdf = 10 ** rng.uniform(-4, 2, geometry.shape) * rng.choice([1, 1, 1, -0.1], geometry.shape)
    u_brdf = np.abs(brdf) * rng.uniform(1e-3, 1e-1, geometry.shape)
    if rng.random() < 0.3:
        u_brdf[:] = np.nan
    known = bool(rng.random() < 0.5)
    table = BrdfTable(
        geometry=geometry, brdf=brdf, u_brdf=u_brdf,
        source_sr=float(rng.uniform(1e-5, 1e-2)) if known else None,
        receiver_sr=float(rng.uniform(1e-5, 1e-2)) if known else None,
    )  # fmt: skip
    facts = {name: strange_text(rng) for name in ("sample", "measurement", "notes")}
    if rng.random() < 0.5:
        facts["wavelength_nm"] = str(rng.choice(["550", "632.8", "550,5", "nm"]))
    return Export(table=table, own_table="", facts=facts)


def relative(export: Export) -> Export:
    """The same without an absolute scale."""
    return replace(export, table=replace(export.table, relative=True))


def _geometry(rng: np.random.Generator, kind: str) -> Geometry:
    several = 1 if kind in ("one incidence", "one point") else int(rng.integers(2, 5))
    theta_i = np.sort(rng.choice(np.arange(0.0, 86.0, 5.0), several, replace=False))
    signed = np.unique(np.round(rng.uniform(-85, 85, rng.integers(5, 40)), 3))
    if kind == "half a sweep":
        signed = -np.abs(signed)
    if kind == "one point":
        signed = signed[:1]
    i, r = (a.reshape(-1) for a in np.meshgrid(theta_i, signed, indexing="ij"))
    dphi: FloatArray = np.zeros(i.size)
    if kind == "out of plane":
        dphi = rng.uniform(0, 360, i.size)
    return Geometry.from_degrees(theta_i=i, theta_r=r, dphi=dphi)
