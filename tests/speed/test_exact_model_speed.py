"""Speed of the exact Oren-Nayar model against the functional form, in one run; values first.

Measured on one core of 2 GHz, the functional form at 0.08 us a geometry:

======  ========  ================  ================  =============
rule    accuracy  nodes a geometry  first evaluation  another sigma
======  ========  ================  ================  =============
COARSE  1e-4      18                14 us             0.45 us
RULE    1e-6      26                22 us             0.55 us
FINE    1e-8      42                75 us             1.0 us
======  ========  ================  ================  =============
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from analysis.models import MODELS
from analysis.models.rough.oren_nayar_exact import FINE, clear_profile_cache, oren_nayar_exact_brdf
from instrument.geometry import Geometry
from tests.support.timing.cpu_time import cpu_ratio

EXACT, FUNCTIONAL = MODELS["oren_nayar_exact"], MODELS["oren_nayar"]
COUNT = 16384


@pytest.fixture(scope="module")
def everywhere() -> Geometry:
    """All angles up to 85 degrees, all azimuths."""
    random = np.random.default_rng(1)
    theta_i, theta_r = random.uniform(0, 85, (2, COUNT))
    return Geometry.from_degrees(
        theta_i=theta_i, theta_r=theta_r, dphi=random.uniform(0, 360, COUNT)
    )


def check(geometry: Geometry, sigma_deg: float) -> None:
    """Some of the values, against the finest rule."""
    few = Geometry.from_degrees(
        theta_i=geometry.theta_i_deg[::64],
        theta_r=geometry.theta_r_deg[::64],
        dphi=geometry.dphi_deg[::64],
    )
    got = EXACT.brdf(geometry, albedo=0.8, sigma_deg=sigma_deg)[::64]
    np.testing.assert_allclose(got, oren_nayar_exact_brdf(few, 0.8, sigma_deg, FINE), rtol=1e-6)


def uncached(geometry: Geometry) -> Callable[[], object]:
    """Evaluation of the functional form without cached values."""
    angles = geometry.theta_i_deg, geometry.theta_r_deg, geometry.dphi_deg
    return lambda: FUNCTIONAL.brdf(Geometry(*angles), albedo=0.8, sigma_deg=20.0)


def test_a_first_evaluation_costs_at_most_five_hundred_functional_ones(
    everywhere: Geometry,
) -> None:
    def first() -> None:
        clear_profile_cache()
        EXACT.brdf(everywhere, albedo=0.8, sigma_deg=20.0)

    assert cpu_ratio(first, uncached(everywhere), 2) < 500  # about 330
    check(everywhere, 20.0)


def test_another_sigma_costs_at_most_twelve_functional_ones(everywhere: Geometry) -> None:
    sigmas = iter(np.linspace(5, 55, 40))
    EXACT.brdf(everywhere, albedo=0.8, sigma_deg=20.0)

    def again() -> None:
        EXACT.brdf(everywhere, albedo=0.8, sigma_deg=float(next(sigmas)))

    assert cpu_ratio(again, uncached(everywhere), 40) < 12
    check(everywhere, 33.0)
    clear_profile_cache()
