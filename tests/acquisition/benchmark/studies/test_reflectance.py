"""Reflectance methods: what each specifies and may cost.

Costs are ratios within one run of two methods timed in turn, never seconds; each limit is two or
three times the value measured on one core of 2 GHz, so that a slow or busy machine passes and a
lost cache or an added loop does not.
"""

from __future__ import annotations

from itertools import cycle

import numpy as np
import pytest

from acquisition.benchmark.studies.reflectance import (
    FUNCTIONAL,
    beckmann_study,
    rough_study,
    wolff_study,
)
from analysis.models import MODELS
from analysis.models.rough.form_error_table import ERROR as TABLE_ERROR
from analysis.models.rough.oren_nayar_exact import clear_profile_cache, oren_nayar_exact_brdf
from instrument.geometry import Geometry
from tests.support.benchmark import FEW, trial_of, worst
from tests.support.timing.cpu_time import cpu_ratio


def test_the_rough_surface_is_as_accurate_as_specified() -> None:
    study = rough_study(FEW)
    for accuracy in (1e-4, 1e-6, 1e-8):
        label = f"exact {accuracy:.0e}".replace("-0", "-")
        assert worst(study, label) <= accuracy
        assert worst(study, f"{label}, first") <= accuracy
    assert worst(study, "table") <= TABLE_ERROR
    for scene in study.scenes:
        typical = [trial_of(study, scene, n).error_median for n in ("Lambert", FUNCTIONAL)]
        assert typical[1] < typical[0]


def test_cost_of_the_exact_rough_surface() -> None:
    """Measured, in functional forms: 6 to 9 where the angles are known, 1200 to 1600 where not."""
    random, size = np.random.default_rng(2), 512
    angles = [
        random.uniform(0, 75, size),
        random.uniform(0, 75, size),
        random.uniform(0, 360, size),
    ]
    sigmas = cycle((10.0, 20.0, 40.0))

    def functional() -> None:
        for _ in range(100):  # each time a geometry for which nothing is cached
            MODELS["oren_nayar"].brdf(Geometry(*angles), albedo=0.8, sigma_deg=next(sigmas))

    def known() -> None:
        for _ in range(10):
            oren_nayar_exact_brdf(Geometry(*angles), 0.8, next(sigmas))

    def first() -> None:
        clear_profile_cache()
        oren_nayar_exact_brdf(Geometry(*angles), 0.8, 20.0)

    assert 100 * cpu_ratio(first, functional, 4) < 4000
    assert 10 * cpu_ratio(known, functional, 10) < 25


def test_the_smooth_dielectric() -> None:
    """`wolff` specifies 1e-10; Chandrasekhar's forms converge to it."""
    study = wolff_study(FEW)
    assert worst(study, "exact H and F") < 1e-10
    orders = [worst(study, f"order {n}") for n in (1, 2, 4, 8, 16)]
    assert orders == sorted(orders, reverse=True)
    assert orders[-1] < 0.01
    # 1998: with 0.07 Wolff's polynomial is 35 % darker at 70/70 degrees, and more beyond.
    assert 0.3 < worst(study, "polynomial F") < 0.6


def test_physical_optics() -> None:
    """The adaptive sum specifies 1e-9 at any roughness."""
    study = beckmann_study(FEW)
    assert worst(study, "adaptive sum") < 1e-9
    smooth, _, rough = study.scenes
    assert trial_of(study, smooth, "10 terms").error < 1e-9
    # e^-g with g of 1000: the first hundred terms hold nothing of the sum.
    assert trial_of(study, rough, "100 terms").error == pytest.approx(1.0)
    on_rough, on_smooth = (trial_of(study, scene, "rough (79)").error for scene in (rough, smooth))
    assert on_rough < 0.01 < on_smooth
