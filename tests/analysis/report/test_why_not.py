"""Reason why a model was not chosen, in the table of a report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.report.sections.models_html import candidates_html
from tests.support.analysis.report_data import data_of, words


def table_of(chi2: float | None) -> str:
    poor, good = data_of().candidates
    other = replace(poor, agrees=False, reduced_chi2=chi2)
    return words(candidates_html(data_of(candidates=(other, good))))


@pytest.mark.parametrize("seed", range(5))
def test_a_model_far_from_the_data_says_how_far(seed: int) -> None:
    times = 10 ** float(np.random.default_rng(seed).uniform(1, 4))
    text = table_of(times**2).partition("does not fit: residuals about ")[2]
    assert float(text.split()[0]) == pytest.approx(times, rel=0.051)
    assert text.split()[1:3] == ["times", "u"]


@pytest.mark.parametrize(
    ("chi2", "said"), [(0.8, "residuals with a pattern"), (None, "residuals too large"),
                       (float("inf"), "residuals too large")],
)  # fmt: skip
def test_a_model_within_u_or_without_one_says_what_is_wrong(chi2: float | None, said: str) -> None:
    assert f"does not fit: {said}" in table_of(chi2)
