"""Real materials: fits of fixed models against figures that others worked out.

The figures come with the tables (notes beside them): unweighted least squares on the BRDF, positive
values only; rms residual over mean value; 116 directions up to 68.8 degrees, or all 205.
"""

from __future__ import annotations

import numpy as np
import pytest

from analysis.choice.choice import choose
from analysis.data.curet import read_curet
from analysis.fit.fit import fit
from analysis.models import MODELS
from tests.support.paths import ROOT

CURET = ROOT.parent / "shared" / "data" / "curet"
pytestmark = pytest.mark.skipif(
    not CURET.is_dir(), reason="the CUReT tables are not beside the project"
)

COLUMNS = (
    *("lambert", "minnaert", "oren_nayar_qualitative", "oren_nayar", "oren_nayar_exact"),
    "oren_nayar+torrance_sparrow_lobe",
)
FIGURES = [
    (10, 68.8, (0.118, 0.117, 0.0527, 0.0188, 0.0213, 0.0184)),
    (11, 68.8, (0.187, 0.187, 0.1018, 0.0424, 0.0401, 0.0424)),
    (45, 68.8, (0.169, 0.164, 0.0588, 0.0350, 0.0346, 0.0234)),
    (50, 68.8, (0.142, 0.135, 0.0538, 0.0383, 0.0426, 0.0351)),
    (49, 68.8, (0.077, 0.075, 0.0284, 0.0322, 0.0414, 0.0140)),
    (10, 90.0, (0.255, 0.246, 0.0832, 0.0497, 0.0610, 0.0433)),
]


@pytest.mark.parametrize(("sample", "max_theta_deg", "figures"), FIGURES)
def test_the_check_fits_within_2_per_cent_of_each_figure(
    sample: int, max_theta_deg: float, figures: tuple[float, ...]
) -> None:
    m = read_curet(CURET, sample, max_theta_deg).measurements
    for name, figure in zip(COLUMNS, figures, strict=True):
        assert fit(MODELS[name], m).rms_relative == pytest.approx(figure, rel=0.02), name


def test_the_plaster_s_parameters() -> None:
    found = fit(MODELS["oren_nayar"], read_curet(CURET, 10).measurements)
    assert found.values["albedo"] == pytest.approx(0.8484, abs=2e-4)
    assert found.values["sigma_deg"] == pytest.approx(np.degrees(0.3844), abs=0.02)


def test_a_model_chosen_for_real_matter_says_that_its_noise_is_an_estimate() -> None:
    chosen = choose(read_curet(CURET, 49, 68.8).measurements)
    assert chosen.verdict == "adequate"
    assert "no u stated" in chosen.reason
    assert max(len(c.values) for c in chosen.candidates) == 5


@pytest.mark.slow
def test_the_automatic_choice_over_the_materials(slow: bool) -> None:
    """All 61 with `pytest --slow`; else one of small misfit, 28."""
    rms = []
    for sample in range(1, 62) if slow else (28,):
        choice = choose(read_curet(CURET, sample, 68.8).measurements)
        rms += [c.rms_relative for c in choice.candidates if c.model == choice.chosen]
    assert np.median(rms) <= (0.055 if slow else 0.03)
