"""Fits of cells in three channels: one sigma, honest u where channels share errors, and misfit."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.sample_maps.cell_fit import CellFits, fit_cells
from analysis.sample_maps.colour.channel_fit import ChannelCells
from analysis.sample_maps.colour.channel_misfit import channel_chi2, independent
from analysis.sample_maps.sigma_table import SigmaTable
from instrument.geometry import FloatArray, Geometry

GLOSSY = "oren_nayar+torrance_sparrow"
VIEWS = np.linspace(-70.0, 70.0, 12)
GEOMETRY = Geometry.from_degrees(
    theta_i=np.repeat([30.0, 60.0], VIEWS.size), theta_r=np.tile(VIEWS, 2)
)
Truth = list[dict[str, FloatArray]]


def _cells(seed: int, model: str, noise: float, common: float) -> tuple[ChannelCells, Truth]:
    """Draw 120 cells with relative u by noise, which blue has twice, and by what channels share."""
    random, count = np.random.default_rng(seed), 120
    sigma = random.uniform(12, 40, count)
    shift = common * random.standard_normal((len(VIEWS) * 2, count))
    truth, brdf, noises, shifts = [], [], [], []
    for u in noise * np.array([1.0, 1.0, 2.0]):
        own = {"albedo": random.uniform(0.2, 0.9, count), "sigma_deg": sigma}
        if model == GLOSSY:
            own["ks"] = random.uniform(0.02, 0.2, count)
        each = [{name: float(v[c]) for name, v in own.items()} for c in range(count)]
        exact = np.stack([MODELS[model].brdf(GEOMETRY, **values) for values in each], axis=1)
        truth.append(own)
        noises.append((u * exact) ** 2)
        shifts.append(common * exact)
        brdf.append(exact * (1 + shift + u * random.standard_normal(exact.shape)))
    return ChannelCells(np.stack(brdf), np.stack(noises), np.stack(shifts)[np.newaxis]), truth


def _pulls(fits: list[CellFits], truth: Truth, name: str) -> FloatArray:
    return np.concatenate(
        [
            (getattr(own, name) - true[name]) / getattr(own, f"u_{name}")
            for own, true in zip(fits, truth, strict=True)
        ]
    )


@pytest.mark.parametrize(
    ("seed", "model", "noise", "common"),
    [(1, "oren_nayar", 0.01, 0.0), (2, "oren_nayar", 0.004, 0.012), (3, GLOSSY, 0.004, 0.004)],
)
def test_the_truth_is_within_u_and_the_model_holds(
    seed: int, model: str, noise: float, common: float
) -> None:
    cells, truth = _cells(seed, model, noise, common)
    table = SigmaTable.of(model, GEOMETRY)
    fits = cells.fitted(table)
    for name in truth[0]:
        pulls = _pulls(fits, truth, name)
        assert 0.8 < np.sqrt(np.nanmean(pulls**2)) < 1.15
    chi2 = channel_chi2(table, fits, cells.judged(), [None] * 3)
    dof = fits[0].count - 3 * (len(truth[0]) - 1) - 1
    assert np.mean(chi2 / dof) == pytest.approx(1.0, abs=0.05)
    assert np.std(chi2 / dof) == pytest.approx(np.sqrt(2 / dof.mean()), rel=0.25)


def test_three_channels_tell_sigma_better_by_their_noise_alone() -> None:
    table = SigmaTable.of("oren_nayar", GEOMETRY)
    for common, best in ((0.0, np.sqrt(1 / 2.25)), (0.02, 1.0)):
        cells, _ = _cells(4, "oren_nayar", 0.004, common)
        variance = cells.noise[0] + cells.common[0, 0] ** 2
        one = fit_cells(table, cells.brdf[0], variance).u_sigma_deg
        three = cells.fitted(table)[0].u_sigma_deg
        assert np.median(three / one) == pytest.approx(best, abs=0.05)


def test_one_channel_without_light_leaves_the_others_their_fit() -> None:
    cells, truth = _cells(5, "oren_nayar", 0.004, 0.002)
    cells.brdf[2, ::2] = np.nan  # as in saturated pictures
    cells.brdf[1, :, :7] = np.nan
    table = SigmaTable.of("oren_nayar", GEOMETRY)
    fits = cells.fitted(table)
    assert np.isnan(fits[0].sigma_deg[:7]).all()
    assert np.isfinite(fits[0].sigma_deg[7:]).all()
    assert fits[0].count[20] == 2.5 * len(VIEWS) * 2
    pulls = _pulls(fits, truth, "sigma_deg")
    assert np.sqrt(np.nanmean(pulls**2)) < 1.15
    chi2 = channel_chi2(table, fits, cells.judged(), [None] * 3)
    assert np.isnan(chi2[:7]).all()
    assert np.nanmean(chi2 / (fits[0].count - 4)) == pytest.approx(1.0, abs=0.06)


def test_what_channels_share_is_made_independent() -> None:
    random = np.random.default_rng(6)
    together = random.normal(size=(2, 3, 1, 1))
    common = np.einsum("jnkc,jkc->nkc", together, random.normal(size=(2, 5, 4000)))
    found = independent(random.normal(size=(3, 5, 4000)) + common, together)
    assert np.cov(found.reshape(3, -1)) == pytest.approx(np.eye(3), abs=0.05)


def test_a_shift_that_all_cells_share_is_allowed_for() -> None:
    cells, _ = _cells(7, "oren_nayar", 0.003, 0.001)
    shifted = cells.brdf * (1 + 0.01 * np.sin(np.arange(24.0))[:, np.newaxis])
    moved = ChannelCells(shifted, cells.noise, cells.common)
    table = SigmaTable.of("oren_nayar", GEOMETRY)
    fits = moved.fitted(table)
    known = 0.01 * np.eye(24)
    blamed = channel_chi2(table, fits, moved.judged(), [None] * 3)
    allowed = channel_chi2(table, fits, moved.judged(), [known] * 3)
    dof = fits[0].count - 4
    assert np.mean(blamed / dof) > 1.5
    assert np.mean(allowed / dof) < 1.1
