"""Misfit beyond shared errors: one of 1000 good cells is rejected, and a wrong model in all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.sample_maps.cell_fit import fit_cells
from analysis.sample_maps.shared_misfit import chi2_beyond_shared
from analysis.sample_maps.sigma_table import SigmaTable
from analysis.sample_maps.spread import rejected
from instrument.geometry import FloatArray, Geometry

GLOSSY = "oren_nayar+torrance_sparrow"
VIEWS = np.linspace(-75.0, 75.0, 24)
AT = Geometry.from_degrees(theta_i=np.repeat([30.0, 55.0], 24), theta_r=np.tile(VIEWS, 2))
CELLS, NOISE = 400, 0.002


def _cells(seed: int, model: str, shared: FloatArray) -> FloatArray:
    """Return cells (K, C) of nearly one surface, all with the same draw of the shared errors."""
    random = np.random.default_rng(seed)
    values = {"albedo": float(random.uniform(0.3, 0.9)), "sigma_deg": float(random.uniform(8, 40))}
    if model == GLOSSY:
        values["ks"] = float(random.uniform(0.03, 0.1))
    curve = MODELS[model].brdf(AT, **values) * (
        1 + shared @ random.standard_normal(shared.shape[1])
    )
    level = random.uniform(0.97, 1.03, CELLS)
    return np.outer(curve, level) * (1 + NOISE * random.standard_normal((curve.size, CELLS)))


def _shared() -> FloatArray:
    """Return relative shifts (K, 26): a tile, a slope over the view angle, and each view alone."""
    views = np.tile(np.eye(24), 2).T
    slope = np.sin(np.radians(np.tile(VIEWS, 2)))
    return np.column_stack([np.full(48, 0.005), 0.004 * slope, 0.004 * views])


@pytest.mark.parametrize("model", ["oren_nayar", GLOSSY])
def test_shared_errors_reject_no_cell_and_a_wrong_model_is_rejected(model: str) -> None:
    shared, blamed, found = _shared(), [], []
    for seed in range(6):
        brdf = _cells(seed, model, shared)
        table, variance = SigmaTable.of(model, AT), (NOISE * brdf) ** 2
        fits = fit_cells(table, brdf, variance)
        chi2 = chi2_beyond_shared(table, fits, brdf, variance, shared)
        assert (chi2 <= fits.chi2 + 1e-6).all()
        dof = fits.count - len(table.parameters)
        blamed.append(rejected(fits.chi2, dof))
        found.append(rejected(chi2, dof))
    assert np.mean(blamed) > 0.5
    assert np.mean(found) < 0.01
    if model == GLOSSY:
        table = SigmaTable.of("oren_nayar", AT)
        fits = fit_cells(table, brdf, variance)
        chi2 = chi2_beyond_shared(table, fits, brdf, variance, shared)
        assert rejected(chi2, fits.count - 2).mean() > 0.99


def test_without_shared_errors_chi2_is_that_of_the_fit() -> None:
    none = np.zeros((48, 1))
    brdf = _cells(7, GLOSSY, none)
    brdf[3, 5] = np.nan
    brdf[1:, 6] = np.nan
    table, variance = SigmaTable.of(GLOSSY, AT), (NOISE * brdf) ** 2
    fits = fit_cells(table, brdf, variance)
    chi2 = chi2_beyond_shared(table, fits, brdf, variance, none)
    assert chi2 == pytest.approx(fits.chi2, rel=0.02, nan_ok=True)
    lost = replace(fits, chi2=np.full(CELLS, np.nan))
    assert np.isnan(chi2_beyond_shared(table, lost, brdf, variance, none)).all()


def test_a_place_in_the_table_is_that_of_its_sigma() -> None:
    for model in ("oren_nayar", GLOSSY):
        table = SigmaTable.of(model, AT)
        place = np.random.default_rng(1).uniform(0, table.sigma_deg.size - 1, 20)
        assert table.place_of(table.sigma_at(place)[0]) == pytest.approx(place)
