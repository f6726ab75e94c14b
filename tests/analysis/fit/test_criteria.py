"""Criteria of a fit: BIC and AICc."""

from __future__ import annotations

import math

import pytest

from analysis.choice.choice import choose
from tests.support.analysis.seeded_scan import (
    scan,
)


def test_bic_of_stated_u_is_chi2_and_penalty() -> None:
    m = scan("lambert", 1, albedo=0.8)
    for c in choose(m, models=["lambert", "oren_nayar"]).candidates:
        assert c.bic == pytest.approx((c.chi2 or 0) + len(c.values) * math.log(m.size))
