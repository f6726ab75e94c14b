"""Means of repeats: as weighted by hand, with their u, and nothing else changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.data.csv.table import read_table
from analysis.data.measurements import Measurements, SharedError
from analysis.data.repeats import mean_of_repeats
from analysis.fit.fit import fit, stated_u
from analysis.models import MODELS
from tests.support.analysis.csv_texts import PLAIN


def test_the_mean_has_the_weights_and_the_u_of_the_guide() -> None:
    """1/u² add: 3 and 1 of weights 1/4 and 1 have the mean 1.4 and 1/u² = 1.25."""
    m = Measurements.bare([30, 60, 30], [5, 5, 5], 0, [3.0, 7.0, 1.0], [2.0, 0.5, 1.0])
    found, repeats = mean_of_repeats(m)
    assert found.theta_i_deg.tolist() == [30, 60]  # in the order of the first rows
    np.testing.assert_allclose(found.brdf, [1.4, 7.0])
    assert found.u_random is not None
    np.testing.assert_allclose(found.u_random, [1.25**-0.5, 0.5])
    assert (repeats.geometries, repeats.rows) == (1, 2)
    assert repeats.scatter == pytest.approx(np.sqrt(0.8**2 + 0.4**2))  # (3 - 1.4)/2, (1 - 1.4)/1


def test_without_u_the_mean_is_plain_and_the_scatter_relative() -> None:
    found, repeats = mean_of_repeats(Measurements.bare(30, [5, 5, 9], 0, [0.2, 0.3, 0.1]))
    assert found.u_random is None
    np.testing.assert_allclose(found.brdf, [0.25, 0.1])
    assert repeats.scatter == pytest.approx(np.sqrt(2 * 0.05**2) / 0.2)


def test_repeats_that_share_no_errors_stay_apart() -> None:
    """Another lamp setting, or another group of a shared error, is another measurement."""
    m = Measurements.bare(30, [5, 5, 5, 5], 0, [0.2, 0.3, 0.4, 0.5], 0.01)
    shared = SharedError("tile", np.array([0.01, 0.03, 0.01, 0.01]), np.array([0, 0, 0, 1]))
    m = replace(m, lamp_setting=np.array([0, 0, 1, 0]), shared=(shared,))
    found, _ = mean_of_repeats(m)
    np.testing.assert_allclose(found.brdf, [0.25, 0.4, 0.5])
    np.testing.assert_allclose(found.shared[0].u_relative, [0.02, 0.01, 0.01])
    assert found.shared[0].group.tolist() == [0, 0, 1]


@given(
    st.lists(st.integers(1, 4), min_size=4, max_size=12),
    st.booleans(),
    st.integers(0, 2**32 - 1),
)
def test_a_fit_to_the_means_is_the_fit_to_all_rows(
    counts: list[int], stated: bool, seed: int
) -> None:
    """Means keep all that a linear model can learn: same albedo, and same u where u is stated."""
    random = np.random.default_rng(seed)
    view = np.repeat(np.arange(len(counts)) * 5.0, counts if stated else 2)
    u = 0.01 * random.uniform(0.5, 2.0, view.size)
    values = 0.2 + u * random.standard_normal(view.size)
    order = random.permutation(view.size)
    m = Measurements.bare(30, view[order], 0, values[order], u[order] if stated else None)
    means, repeats = mean_of_repeats(m)
    whole, of_means = (fit(MODELS["lambert"], one) for one in (m, means))
    assert of_means.values["albedo"] == pytest.approx(whole.values["albedo"], rel=1e-9)
    if stated:
        # Apart from the scatter, which may enlarge either: they have different degrees of freedom.
        u_whole, u_means = stated_u(whole, m)["albedo"], stated_u(of_means, means)["albedo"]
        assert u_means == pytest.approx(u_whole, rel=1e-9)
    assert repeats.rows - repeats.geometries == m.size - means.size


def test_scatter_above_u_is_told_from_chance() -> None:
    view = np.repeat(np.arange(60.0), 3)
    noise = np.random.default_rng(3).standard_normal(view.size)
    for factor, exceeds in ((1.0, False), (2.0, True)):
        values = 0.2 + 0.001 * factor * noise
        assert mean_of_repeats(Measurements.bare(30, view, 0, values, 0.001))[1].exceed_u is exceeds


def test_a_table_with_repeats_is_read_on_request(tmp_path: Path) -> None:
    path = tmp_path / "repeats.csv"
    path.write_text(PLAIN + PLAIN.partition("\n")[2])
    assert read_table(path, repeats=True).measurements.size == 4
