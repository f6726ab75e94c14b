"""Fits averaged over the acceptance of the rig."""

from __future__ import annotations

import pytest

from analysis.fit.fit import fit
from analysis.models import MODELS
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
