"""Folder of tables with noise: rough, matt, one that determines nothing, one that is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.models import MODELS as ALL
from instrument.geometry import Geometry

MODELS = "lambert,oren_nayar_qualitative"
BAD = "bad.csv"
_VIEWS = np.arange(-70.0, 71.0, 10.0)
_HEADER = "theta_i_deg,theta_r_deg,dphi_deg,brdf,u_brdf\n"


def write_tables(folder: Path, seed: int, rough: int = 1) -> Path:
    """Write the tables, of which `rough` are rough with random parameters; return the folder."""
    random = np.random.default_rng(seed)
    (folder / "sub").mkdir(parents=True)
    name = "oren_nayar_qualitative"
    for n in range(rough):
        truth = {"albedo": random.uniform(0.3, 0.9), "sigma_deg": random.uniform(10.0, 40.0)}
        text = _table(random, name, [30.0, 60.0], truth)
        (folder / f"rough{n or ''}.csv").write_text(text)
    (folder / "sub" / "matt.csv").write_text(
        _table(random, "lambert", [30.0, 60.0], {"albedo": random.uniform(0.3, 0.9)})
    )
    one = f"{_HEADER}0,0,0,0.1,0.001\n"
    (folder / "undetermined.csv").write_text(one)
    (folder / BAD).write_text("theta_i_deg,theta_r_deg\n1,2\n")
    return folder


def _table(
    random: np.random.Generator, model: str, theta_i_deg: list[float], truth: dict[str, float]
) -> str:
    theta_i, theta_r = (a.ravel() for a in np.meshgrid(theta_i_deg, _VIEWS, indexing="ij"))
    f = ALL[model].brdf(Geometry.from_degrees(theta_i=theta_i, theta_r=theta_r), **truth)
    f = f * (1 + 0.005 * random.standard_normal(f.size))
    rows = zip(theta_i, theta_r, f, strict=True)
    return _HEADER + "".join(f"{i},{r},0,{v},{0.005 * v}\n" for i, r, v in rows)
