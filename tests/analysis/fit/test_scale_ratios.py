"""Ratios of scales: right within their u, with and without a reference, for several models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analysis.data.measurements import Measurements
from analysis.fit.fit import FitResult, fit
from analysis.fit.scale_ratios import ratio_names
from analysis.models import MODELS

THETA_I, THETA_R = (
    a.ravel() for a in np.meshgrid([30.0, 45.0, 60.0], np.arange(-75.0, 76.0, 7.5), indexing="ij")
)
U = 0.003  # relative
CASES = {
    "lambert+torrance_sparrow": {"albedo": 0.5, "ks": 0.1, "sigma_deg": 20.0},
    "oren_nayar+torrance_sparrow": {"albedo": 0.75, "sigma_deg": 42.0, "ks": 0.34},
    "lambert+ggx": {"albedo": 0.02, "f0": 0.04, "alpha": 0.3},  # the lobe's scale is the larger
    "lambert+torrance_sparrow_lobe": {"albedo": 0.3, "ks": 0.2, "lobe_sigma_deg": 12.0},
}


def measured(name: str, seed: int, unit: float | None = None) -> Measurements:
    """Noisy data of a case; `unit` of relative values without a reference, None: in 1/sr."""
    m = Measurements.bare(THETA_I, THETA_R, 0.0, 1.0, 1.0)
    f = (unit or 1.0) * MODELS[name].brdf(m.geometry, **CASES[name])
    noisy = f * (1 + U * np.random.default_rng([8, seed]).standard_normal(f.size))
    return replace(m, brdf=noisy, u_random=U * f, relative=unit is not None)


def pull(result: FitResult, name: str) -> float:
    """(Value - truth) / u of the only ratio."""
    ((ratio, found),) = result.ratios.items()
    above, below = (CASES[name][part] for part in ratio.split("/"))
    assert found.u is not None
    assert found.interval is None
    return (found.value - above / below) / found.u


@pytest.mark.slow
@pytest.mark.parametrize("unit", [None, 37.0], ids=["1/sr", "relative"])
@pytest.mark.parametrize("name", CASES)
def test_a_ratio_is_right_within_its_u(name: str, unit: float | None, slow: bool) -> None:
    """The standard deviation of n pulls has a standard error of 1/sqrt(2 n)."""
    count = 200 if slow else 4 if unit is None else 3
    pulls = [pull(fit(MODELS[name], measured(name, n, unit)), name) for n in range(count)]
    spread = np.sqrt(np.mean(np.square(pulls)))
    assert abs(spread - 1) < (4 / np.sqrt(2 * count))


def test_a_unit_changes_no_ratio() -> None:
    name = "lambert+torrance_sparrow"
    found = [fit(MODELS[name], measured(name, 1, unit)).ratios["ks/albedo"] for unit in (1.0, 9.0)]
    assert found[0].value == pytest.approx(found[1].value, rel=1e-5)
    assert found[0].u == pytest.approx(found[1].u, rel=1e-3)


def test_a_ratio_has_the_u_that_follows_from_two_known_scales() -> None:
    name = "lambert+torrance_sparrow"
    result = fit(MODELS[name], measured(name, 1))
    ks, albedo = result.values["ks"], result.values["albedo"]
    u_ks, u_albedo = result.u["ks"], result.u["albedo"]
    assert u_ks is not None
    assert u_albedo is not None
    names = [p.name for p in result.problem.model.parameters]
    r = result.correlation[names.index("ks"), names.index("albedo")]
    a, b = u_ks / ks, u_albedo / albedo
    expected = ks / albedo * np.sqrt(a * a + b * b - 2 * r * a * b)
    found = result.ratios["ks/albedo"]
    assert found.value == pytest.approx(ks / albedo)
    assert found.u == pytest.approx(expected, rel=1e-3)


def test_a_lobe_that_is_not_there_has_a_ratio_without_u() -> None:
    m = Measurements.bare(THETA_I, THETA_R, 0.0, 0.25 / np.pi, 0.001)
    ratio = fit(MODELS["lambert+torrance_sparrow"], m).ratios.get("ks/albedo")
    if ratio is not None:
        assert ratio.u is None
        assert ratio.interval is not None
        assert ratio.interval[0] < 1e-3


def test_models_of_one_scale_have_no_ratio() -> None:
    assert ratio_names(MODELS["oren_nayar"]) == ()
    assert ratio_names(MODELS["ggx"]) == ()
    assert ratio_names(MODELS["wolff"]) == ()
    assert ratio_names(MODELS["unified"]) == ("lobe/diffuse", "spike/diffuse")
    m = Measurements.bare(THETA_I, THETA_R, 0.0, 0.1, 0.001)
    assert fit(MODELS["oren_nayar"], m).ratios == {}
