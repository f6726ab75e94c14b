"""Fits averaged over the acceptance of the rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.acceptance import Acceptance, averaged_brdf
from analysis.data.measurements import Measurements
from analysis.fit.fit import fit
from analysis.models import MODELS
from instrument.geometry import FloatArray, Geometry
from tests.support.analysis.seeded_scan import RIG, scan


def test_averaging_is_applied_only_where_it_matters() -> None:
    truth = {"albedo": 0.8, "sigma_deg": 20.0, "ks": 0.076}
    model = MODELS["oren_nayar+torrance_sparrow"]
    m = scan(model.name, 4, acceptance=RIG, **truth)
    found = fit(model, m, RIG)
    assert found.averaged
    assert found.converged
    assert (found.reduced_chi2 or 9) < 1.5 < (fit(model, m).reduced_chi2 or 0)
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, abs=4 * (found.u[name] or 0))
    assert not fit(MODELS["lambert"], scan("lambert", 4, acceptance=RIG, albedo=0.8), RIG).averaged


def glossy(random: np.random.Generator, low: float, high: float) -> dict[str, float]:
    """Parameters of lambert+ggx, alpha between these."""
    return {
        "albedo": random.uniform(0.2, 0.7),
        "f0": random.uniform(0.03, 0.06),
        "alpha": random.uniform(low, high),
    }


@pytest.mark.parametrize("seed", range(4))
def test_averaging_is_so_exact_that_it_shifts_no_parameter_by_a_part_of_its_u(seed: int) -> None:
    """Values without an error, whose u is that of a good scan."""
    random = np.random.default_rng(seed)
    truth = glossy(random, 0.25, 0.45)
    model, views = MODELS["lambert+ggx"], np.arange(-80.0, 81.0, 12.0)
    lamps = np.repeat(random.uniform(10.0, 65.0, 2), views.size)
    angles = (lamps, np.tile(views, 2), np.zeros(lamps.size))
    exact = averaged_brdf(lambda g: model.brdf(g, **truth), *angles, RIG, 3)
    found = fit(model, Measurements.bare(*angles, exact, 7e-4 * exact), RIG)
    assert found.averaged
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, abs=0.03 * (found.u[name] or 0)), name


@pytest.mark.parametrize(("seed", "rig"), [(0, None), (1, None), (2, None), (3, RIG)])
def test_a_turn_during_the_exposure_shifts_no_parameter_by_a_part_of_its_u(
    seed: int, rig: Acceptance | None
) -> None:
    """Lobes of some 10 degrees, each frame over up to half of that; its mean is a sum of many."""
    random = np.random.default_rng([seed, 7])
    truth = glossy(random, 0.1, 0.2)
    model, views = MODELS["lambert+ggx"], np.arange(-75.0, 76.0, 2.5)
    lamps = np.repeat(random.uniform(20.0, 60.0, 2), views.size)
    theta_r, blur_deg = np.tile(views, 2), random.uniform(2.0, 5.0, lamps.size)

    def taken(at: FloatArray) -> FloatArray:
        if rig is None:
            return model.brdf(Geometry.from_degrees(theta_i=lamps, theta_r=at, dphi=0.0), **truth)
        none = np.zeros(lamps.size)
        return averaged_brdf(lambda g: model.brdf(g, **truth), lamps, at, none, rig, 2)

    parts = (np.arange(25) + 0.5) / 25 - 0.5
    mean = np.mean([taken(theta_r + part * blur_deg) for part in parts], axis=0)
    m = Measurements.bare(lamps, theta_r, 0.0, mean, 2e-3 * mean)
    found = fit(model, replace(m, blur_deg=blur_deg), rig)
    assert found.averaged
    assert found.converged
    for name, value in truth.items():
        assert found.values[name] == pytest.approx(value, abs=0.1 * (found.u[name] or 0)), name
    unaware = fit(model, m, rig)
    assert abs(unaware.values["alpha"] - truth["alpha"]) > 2 * (found.u["alpha"] or 0)
