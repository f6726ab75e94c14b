"""Maker of `form_error_table.npz`: the exact Oren-Nayar integral on the table's grid.

`python -m acquisition.benchmark.maps.make_form_error_table` computes it in a second. Its reader is
`analysis.models.rough.form_error_table`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from analysis.models.lambert import DARKEST
from analysis.models.rough.form_error_table import FILE, GRID
from analysis.models.rough.oren_nayar_exact import oren_nayar_exact_brdf
from instrument.geometry import FloatArray, Geometry


def form_error_table() -> FloatArray:
    """Direct and two-bounce radiance times pi, in 1/sr: (sigma, larger, ratio, dphi, 2)."""
    larger, ratio, dphi = np.meshgrid(*list(GRID.values())[1:], indexing="ij")
    geometry = Geometry.from_degrees(theta_i=larger, theta_r=larger * ratio, dphi=dphi)
    rows = []
    for sigma_deg in GRID["sigma_deg"]:
        direct = oren_nayar_exact_brdf(geometry, DARKEST, float(sigma_deg)) * np.pi / DARKEST
        both = oren_nayar_exact_brdf(geometry, 1.0, float(sigma_deg)) * np.pi
        rows.append(np.stack([direct, both - direct], axis=-1))
    return np.stack(rows)


def write(file: Path = FILE) -> None:
    """Compute the table and store it as 32-bit numbers."""
    values = form_error_table().astype(np.float32)
    np.savez_compressed(file, allow_pickle=False, direct_and_twice=values, **GRID)


if __name__ == "__main__":
    write()
