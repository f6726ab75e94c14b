"""Fits of cells: the exact fit's values and u, truth within u, and cells that hold too little."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from analysis.sample_maps.cell_fit import CellFits, determined, fit_cells
from analysis.sample_maps.sigma_table import MAPPED, SigmaTable
from instrument.geometry import Geometry
from tests.support.sample_maps.cells import Cells, random_cells

GLOSSY = "oren_nayar+torrance_sparrow"


def _fitted(cells: Cells) -> CellFits:
    table = SigmaTable.of(cells.model, cells.geometry)
    return fit_cells(table, cells.brdf.astype(np.float32), cells.variance)


@pytest.mark.parametrize(("seed", "model"), list(enumerate(["oren_nayar", GLOSSY] * 2)))
def test_a_cell_has_the_values_and_u_of_the_exact_fit(seed: int, model: str) -> None:
    cells = random_cells(seed, model, 8)
    found = _fitted(cells)
    at = cells.geometry
    signed = np.where(at.dphi_deg == 180, -at.theta_r_deg, at.theta_r_deg)
    for c in range(8):
        u = np.sqrt(cells.variance[:, c])
        exact = fit(
            MODELS[model], Measurements.bare(at.theta_i_deg, signed, 0.0, cells.brdf[:, c], u)
        )
        assert abs(found.sigma_deg[c] - exact.values["sigma_deg"]) < 0.01
        for name in exact.values:
            value, u_value = getattr(found, name)[c], getattr(found, f"u_{name}")[c]
            assert value == pytest.approx(exact.values[name], abs=0.03 * u_value)
            if exact.u[name] is not None:
                assert u_value == pytest.approx(exact.u[name], rel=0.1)
        assert found.chi2[c] == pytest.approx(exact.chi2, rel=1e-2, abs=0.1)


@pytest.mark.parametrize("incidences", [(30.0, 60.0), (45.0,)])
def test_the_truth_lies_within_u_as_often_as_it_should(incidences: tuple[float, ...]) -> None:
    inside, chi2 = [], []
    for seed in range(10, 14):
        cells = random_cells(seed, GLOSSY if seed % 2 else "oren_nayar", 150, incidences)
        found = _fitted(cells)
        known = determined(found)
        assert known.mean() > 0.9
        for name, truth in cells.truth.items():
            off = (getattr(found, name) - truth) / getattr(found, f"u_{name}")
            inside.append(np.abs(off[known]) < 1.96)
        chi2.append(found.chi2 / (found.count - len(cells.truth)))
    assert 0.92 < np.mean(np.concatenate(inside)) < 0.98
    assert np.mean(chi2) == pytest.approx(1.0, abs=0.05)


def test_values_that_are_missing_count_in_no_sum() -> None:
    cells = random_cells(3, "oren_nayar", 6)
    table = SigmaTable.of("oren_nayar", cells.geometry)
    lost = np.zeros(cells.brdf.shape, dtype=bool)
    lost[::3] = True
    brdf = np.where(lost, np.nan, cells.brdf)
    few = fit_cells(table, brdf, cells.variance)
    kept = Geometry(*(a[~lost[:, 0]] for a in (
        cells.geometry.theta_i_deg, cells.geometry.theta_r_deg, cells.geometry.dphi_deg
    )))  # fmt: skip
    own = fit_cells(
        SigmaTable.of("oren_nayar", kept), cells.brdf[~lost[:, 0]], cells.variance[~lost[:, 0]]
    )
    assert few.sigma_deg == pytest.approx(own.sigma_deg, abs=1e-6)
    assert few.count.tolist() == own.count.tolist()
    infinite = np.where(lost, np.inf, cells.variance)
    assert fit_cells(table, cells.brdf, infinite).albedo == pytest.approx(own.albedo)


def test_a_cell_with_too_few_values_has_no_fit() -> None:
    cells = random_cells(4, "oren_nayar", 3)
    brdf = cells.brdf.copy()
    brdf[:, 0] = np.nan
    brdf[2:, 1] = np.nan
    found = fit_cells(SigmaTable.of("oren_nayar", cells.geometry), brdf, cells.variance)
    assert found.count.tolist() == [0, 2, cells.brdf.shape[0]]
    assert np.isnan(found.sigma_deg).tolist() == [True, True, False]
    assert np.isnan(found.chi2[:2]).all()


def test_a_cell_without_a_lobe_has_none_of_a_negative_strength() -> None:
    cells = random_cells(5, "oren_nayar", 40)
    matt = fit_cells(SigmaTable.of("oren_nayar", cells.geometry), cells.brdf, cells.variance)
    glossy = fit_cells(SigmaTable.of(GLOSSY, cells.geometry), cells.brdf, cells.variance)
    assert glossy.ks.min() == 0
    none = (glossy.ks == 0) & (matt.sigma_deg > 1)
    assert none.any()
    assert glossy.sigma_deg[none] == pytest.approx(matt.sigma_deg[none], abs=5e-3)


def test_a_plane_and_the_end_of_the_table_are_told() -> None:
    at = Geometry.from_degrees(theta_i=45.0, theta_r=np.linspace(-70, 70, 15))
    flat = MODELS["lambert"].brdf(at, albedo=0.5)
    rough = MODELS["oren_nayar"].brdf(at, albedo=0.5, sigma_deg=60.0)
    rough = rough + 0.1 * (rough - flat)  # rougher than any in the table
    brdf = np.stack([flat, rough], axis=1)
    found = fit_cells(SigmaTable.of("oren_nayar", at), brdf, (0.01 * brdf) ** 2)
    assert found.sigma_deg == pytest.approx([0.0, 60.0], abs=0.01)
    assert np.isnan(found.u_sigma_deg).tolist() == [True, True]
    assert found.albedo[0] == pytest.approx(0.5, rel=1e-3)


def test_every_mapped_model_is_the_sum_of_its_parts() -> None:
    random = np.random.default_rng(6)
    at = Geometry.from_degrees(theta_i=50.0, theta_r=random.uniform(-80, 80, 20))
    for name in MAPPED:
        table = SigmaTable.of(name, at)
        row = int(random.integers(1, table.sigma_deg.size))
        albedo, ks = random.uniform(0.1, 1.0, 2)
        own = {"albedo": albedo, "sigma_deg": table.sigma_deg[row]}
        parts = albedo * table.once[row] + albedo**2 * table.twice[row]
        if table.lobe is not None:
            parts, own["ks"] = parts + ks * table.lobe[row], ks
        assert parts == pytest.approx(MODELS[name].brdf(at, **own), rel=1e-9)
        place = np.array([float(row)])
        assert table.sigma_at(place)[0] == pytest.approx(own["sigma_deg"])
    with pytest.raises(ValueError, match="model 'ggx'; allowed for a map: oren_nayar, "):
        SigmaTable.of("ggx", at)
