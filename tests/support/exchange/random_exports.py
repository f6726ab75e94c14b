"""Random exports, by seed: tables of every kind a run can give, models, and facts of strangers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.exchange.exported import BrdfTable, Export, ExportedModel
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry

KINDS = ("one point", "half a sweep", "one incidence", "several incidences", "out of plane")

NASTY = (
    'paint "A"; #1',
    "two\nlines\r\nof 'text'",
    "tab\tand \x00 nul, \x1b[31m",
    "<&]]> % {} $(x)",
    "Ä µ 白 \u2028 end",
    "\udcff",
    "  ",
    "NUM_POINTS 5",
)


def random_table(seed: int, kind: str) -> BrdfTable:
    """Table (N,) with angles in degrees and BRDF in 1/sr, some of it negative, some without u."""
    rng = np.random.default_rng((seed, KINDS.index(kind)))
    geometry = _geometry(rng, kind)
    brdf = rng.uniform(0, 0.5, geometry.shape) - 0.02
    u = rng.choice([np.nan, 1.0], geometry.shape) * rng.uniform(1e-4, 1e-2, geometry.shape)
    u = np.full(geometry.shape, np.nan) if seed % 3 == 0 else u
    return BrdfTable(
        geometry=geometry,
        brdf=brdf,
        u_brdf=u,
        relative=seed % 4 == 3,
        source_sr=None if seed % 2 else 1e-3,
        receiver_sr=None if seed % 5 == 0 else 2.5e-4,
    )


def random_export(seed: int, kind: str, model: ExportedModel | None = None) -> Export:
    """Export of a random table, with facts that no file may break on."""
    rng = np.random.default_rng((seed, 77))
    names = ("sample", "rig", "notes", "operator")
    facts = {name: str(rng.choice(NASTY)) for name in names}
    facts["measured_utc"] = "2026-11-20T10:00:00Z to 2026-11-20T10:30:00Z"
    return Export(table=random_table(seed, kind), own_table="", facts=facts, model=model)


def absolute(export: Export) -> Export:
    """The same export with values in 1/sr."""
    return replace(export, table=replace(export.table, relative=False))


def fitted(name: str, verdict: str = "adequate", **values: float) -> ExportedModel:
    """Model as a fit would give it: those of its parameters that are not named at their default."""
    model = MODELS[name]
    values = {p.name: values.get(p.name, p.default) for p in model.parameters}

    def brdf(geometry: Geometry) -> FloatArray:
        """BRDF in 1/sr of the geometry's shape."""
        return model.brdf(geometry, **values)

    u = {parameter: None if i else 0.01 for i, parameter in enumerate(values)}
    return ExportedModel(name=name, verdict=verdict, values=values, u=u, brdf=brdf)


def _geometry(rng: np.random.Generator, kind: str) -> Geometry:
    if kind == "out of plane":
        angles = (rng.uniform(0, 85, 40), rng.uniform(0, 85, 40), rng.uniform(0, 360, 40))
        return Geometry.from_degrees(theta_i=angles[0], theta_r=angles[1], dphi=angles[2])
    incidences = {"one point": 1, "half a sweep": 1, "one incidence": 1}.get(kind, 3)
    theta_i = np.sort(rng.choice(np.arange(0, 80, 5), incidences, replace=False)).astype(float)
    views = rng.permutation(np.unique(np.round(rng.uniform(-80, 80, 25), 1)))
    if kind == "one point":
        views = views[:1]
    if kind == "half a sweep":
        views = np.sort(np.abs(views))
    grid = np.meshgrid(theta_i, views, indexing="ij")
    return Geometry.from_degrees(theta_i=grid[0].ravel(), theta_r=grid[1].ravel())
